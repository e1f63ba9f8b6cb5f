// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/sample_surface.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "core/errors.h"
#include "core/memory.h"
#include "core/random.h"
#include "sampling/crossings.h"

namespace arapfields {
namespace {

constexpr Index fewest_lines = 1024;
constexpr Index most_lines_a_round = 1 << 18;
constexpr Index hopeless_lines = 1 << 18;  // without a crossing: there is no surface
constexpr std::uint64_t shuffle_stream = ~std::uint64_t{0};

/// The model pays off while it has fewer cells than a quarter of the points wanted.
TricubicSurrogateOptions model_options(Index count) {
  return {.target_cells = std::clamp<Index>(count / 4, 200, 50'000), .max_cells_a_side = 128};
}

/// Casts lines and keeps those that cross, with a bracket for every crossing.
class Caster {
 public:
  Caster(EvaluationCounter& function, const TricubicSurrogate& model, std::uint64_t seed)
      : function_(function), model_(model), box_(model.bounds()), seed_(seed) {}

  /// Brackets of `count` further lines, appended to `brackets`.
  void cast(Index count) {
    std::vector<Line> fresh(count);
    for (Line& line : fresh) {
      Random random(seed_, static_cast<std::uint64_t>(cast_++));
      line = random_line(box_, random);
    }
    ScanResult scan = scan_lines(model_, fresh);
    const std::vector<Bracket> more = resolve_ambiguous(function_, model_, fresh, scan.ambiguous);
    scan.brackets.insert(scan.brackets.end(), more.begin(), more.end());
    std::sort(scan.brackets.begin(), scan.brackets.end(), [](const Bracket& a, const Bracket& b) {
      return a.line != b.line ? a.line < b.line : a.low < b.low;
    });
    Index before = -1;
    for (Bracket each : scan.brackets) {
      if (each.line != before) lines.push_back(fresh[each.line]);
      before = each.line;
      each.line = static_cast<Index>(lines.size()) - 1;
      brackets.push_back(each);
    }
  }
  Index lines_cast() const { return cast_; }
  /// Lines that should yield `crossings` more.
  Index lines_for(Index crossings) const {
    const double spacing = model_.spacing();
    // Before the first cast: the surface's area from the volume of the cells around it.
    double rate = static_cast<double>(model_.active().size()) * spacing * spacing / 2.0 / box_.area();
    if (!brackets.empty()) rate = static_cast<double>(brackets.size()) / static_cast<double>(cast_);
    return std::clamp(static_cast<Index>(1.02 * static_cast<double>(crossings) / std::max(rate, 1e-6)),
                      fewest_lines, most_lines_a_round);
  }

  std::vector<Line> lines;
  std::vector<Bracket> brackets;

 private:
  EvaluationCounter& function_;
  const TricubicSurrogate& model_;
  Box box_;
  std::uint64_t seed_;
  Index cast_ = 0;
};

[[noreturn]] void throw_empty(const std::string& observed) {
  throw InvalidInput("sdf", observed, "a function with a zero surface inside the cube [-1, 1]^3 is needed");
}

void shuffle(std::vector<Bracket>& items, std::size_t begin, Random& random) {
  for (std::size_t i = begin; i + 1 < items.size(); ++i)
    std::swap(items[i], items[i + random.below(items.size() - i)]);
}

}  // namespace

SurfaceSamples sample_surface(const ImplicitFunction& implicit, const SampleOptions& options,
                              const Progress& progress, SampleReport* report) {
  options.validate();
  require_memory("count", 12.0 * sizeof(double) * static_cast<double>(options.count));
  const auto start = std::chrono::steady_clock::now();
  progress.report(0.0, "measuring the implicit function");
  EvaluationCounter function(implicit, progress);
  const TricubicSurrogate model(function, model_options(options.count));
  const Index model_evaluations = function.value_count() + function.gradient_count();
  if (model.active().empty()) throw_empty("its values keep one sign in the whole cube");

  SurfaceSamples samples;
  samples.frame = implicit.frame();
  samples.points.resize(options.count, 3);
  samples.normals.resize(options.count, 3);
  const auto seed = static_cast<std::uint64_t>(options.seed);
  Caster caster(function, model, seed);
  Random order(seed, shuffle_stream);
  Index done = 0;
  double largest = 0.0;
  std::size_t used = 0;  // brackets searched so far
  while (done < options.count) {
    const auto pool = [&] { return static_cast<Index>(caster.brackets.size() - used); };
    const Index missing = options.count - done;
    while (pool() < missing) {
      progress.report(0.3 + 0.4 * static_cast<double>(done + pool()) / static_cast<double>(options.count),
                      "casting lines");
      caster.cast(caster.lines_for(missing - pool()));
      if (caster.brackets.empty() && caster.lines_cast() > hopeless_lines)
        throw_empty("no line of " + std::to_string(caster.lines_cast()) + " crosses its zero surface");
    }
    // Which crossings are kept must not depend on where they are.
    shuffle(caster.brackets, used, order);
    const auto begin = caster.brackets.begin() + static_cast<std::ptrdiff_t>(used);
    const std::vector<Bracket> chosen(begin, begin + missing);
    used += chosen.size();
    progress.report(0.7, "finding the crossings");
    const Crossings crossings = find_crossings(function, caster.lines, chosen, options.tolerance);
    const Index fresh = crossings.points.rows();
    samples.points.middleRows(done, fresh) = crossings.points.cast<double>();
    samples.normals.middleRows(done, fresh) = crossings.gradients.cast<double>().rowwise().normalized();
    done += fresh;
    largest = std::max(largest, crossings.largest);
  }
  if (report != nullptr)
    *report = {.lines = caster.lines_cast(),
               .value_evaluations = function.value_count(),
               .gradient_evaluations = function.gradient_count(),
               .model_evaluations = model_evaluations,
               .lipschitz = model.lipschitz(),
               .largest_value = largest,
               .seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count()};
  progress.report(1.0, "sampled the surface");
  return samples;
}

SurfaceSamples sample_surface(const std::shared_ptr<const ImplicitFunction>& function,
                              const SampleOptions& options, const Progress& progress, SampleReport* report) {
  SurfaceSamples samples = sample_surface(*function, options, progress, report);
  samples.redraw = [function, options](Index count, std::uint64_t seed) {
    SampleOptions again = options;
    again.count = static_cast<int>(count);
    again.seed = static_cast<std::int64_t>(seed >> 11);  // options hold 53 bits
    return sample_surface(*function, again);
  };
  return samples;
}

}  // namespace arapfields
