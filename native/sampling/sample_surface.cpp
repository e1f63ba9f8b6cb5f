// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/sample_surface.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

#include "core/errors.h"
#include "core/memory.h"
#include "core/random.h"
#include "core/types.h"
#include "sampling/crossings.h"
#include "sampling/evaluation_counter.h"

namespace arapfields {

/// Unit normals at points of {Φ = 0}. If ∇Φ does not agree with finite differences of Φ (noise, quantised
/// distances), they are central differences with the smallest step that agrees with twice the step.
class SurfaceNormals {
 public:
  explicit SurfaceNormals(EvaluationCounter& function) : function_(function) {}

  /// Normals (n,3), from ∇Φ at the points; a row of zeros where Φ is locally constant. The points of the
  /// first call determine the step.
  Points operator()(const PointsF& points, const PointsF& gradients);

 private:
  Points differences(const PointsF& points, double step);
  void choose_step(const PointsF& points, const Points& gradients);

  EvaluationCounter& function_;
  bool chosen_ = false;
  double step_ = 0.0;  // 0: gradients are used
};

namespace {

constexpr Index probes = 64;                            // points that determine the step
constexpr double least_step = 4e-3, most_step = 0.128;  // in cube units; each is twice the one before
// Cosines of 15 and 5 degrees: bounds on the median angle for gradients to be trusted and steps to agree.
constexpr double trusted = 0.9659, settled = 0.9962;

double median_cosine(const Points& a, const Points& b) {
  Vector cosines = a.cwiseProduct(b).rowwise().sum();
  const auto middle = cosines.begin() + cosines.size() / 2;
  std::nth_element(cosines.begin(), middle, cosines.end());
  return *middle;
}

}  // namespace

/// Unit vectors of central differences, at points clamped to the cube.
Points SurfaceNormals::differences(const PointsF& points, double step) {
  const Index n = points.rows();
  PointsF shifted = points.replicate(6, 1);
  for (int axis = 0; axis < 3; ++axis) {
    auto ahead = shifted.col(axis).segment(2 * axis * n, n),
         behind = shifted.col(axis).segment((2 * axis + 1) * n, n);
    ahead = (ahead.array() + static_cast<float>(step)).min(1.0f).max(points.col(axis).array());
    behind = (behind.array() - static_cast<float>(step)).max(-1.0f).min(points.col(axis).array());
  }
  const VectorF values = function_.values(shifted);
  Points result(n, 3);
  for (int axis = 0; axis < 3; ++axis) {
    const Index ahead = 2 * axis * n, behind = ahead + n;
    result.col(axis) =
        (values.segment(ahead, n) - values.segment(behind, n)).cast<double>().array() /
        (shifted.col(axis).segment(ahead, n) - shifted.col(axis).segment(behind, n)).cast<double>().array();
  }
  return unit_rows(result);
}

void SurfaceNormals::choose_step(const PointsF& points, const Points& gradients) {
  const Index taken = std::min<Index>(points.rows(), probes);
  const PointsF some = points.topRows(taken);
  Points finer = gradients.topRows(taken);
  double wanted = trusted, best = -1.0, of_finer = 0.0;
  for (double step = least_step; step <= most_step; step *= 2.0) {
    const Points wider = differences(some, step);
    const double agreement = median_cosine(finer, wider);
    if (agreement > best) best = agreement, step_ = of_finer;
    if (agreement >= wanted) return;
    wanted = settled, of_finer = step, finer = wider;
  }
}

Points SurfaceNormals::operator()(const PointsF& points, const PointsF& gradients) {
  Points normals = unit_rows(gradients.cast<double>());
  if (points.rows() == 0) return normals;
  if (!chosen_) choose_step(points, normals);
  chosen_ = true;
  if (step_ > 0.0) normals = differences(points, step_);
  for (double step = std::max(least_step, 2.0 * step_); step <= 2.0 * most_step; step *= 2.0) {
    std::vector<Index> flat;
    for (Index i = 0; i < normals.rows(); ++i)
      if (!(normals.row(i).squaredNorm() > 0.0)) flat.push_back(i);
    if (flat.empty()) break;
    normals(flat, Eigen::all) = differences(points(flat, Eigen::all), step);
  }
  return normals;
}

namespace {

constexpr Index fewest_lines = 1024;
constexpr Index most_lines_a_round = 1 << 18;
constexpr Index hopeless_lines = 1 << 18;  // without a crossing: there is no surface
// Limits of the work. Smooth surfaces take ten values a sample, those with noise of 0.001 a hundred.
constexpr Index most_lines_a_sample = 1 << 15, most_values = 1 << 20, most_values_a_sample = 1 << 10;
// Sign changes after which less than one zero in share_of_signs of them is an error: Φ jumps instead.
constexpr Index fewest_sign_changes = 1000, share_of_signs = 100;
constexpr double least_slope = 1e-5;  // a distance's is 1; points are where |Φ| is below 2e-6
constexpr double thickest = 0.1;  // largest mean length of a line's parts with Φ = 0, cube units a crossing
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
    const std::vector<Bracket> more =
        resolve_ambiguous(function_, model_, fresh, scan.ambiguous, finest_interval, &zero_length);
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
  /// Expected number of lines for `crossings` more.
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
  double zero_length = 0.0;  // of the lines, where the function is exactly 0

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

/// Throws InvalidInput if the crossings so far are not those of a surface, or too few.
void require_surface(const Caster& caster, const EvaluationCounter& function, Index wanted) {
  const auto crossings = static_cast<Index>(caster.brackets.size());
  const Index cast = caster.lines_cast();
  if (caster.zero_length > thickest * static_cast<double>(std::max(crossings, cast / share_of_signs)))
    throw_empty("it is 0 on an open set of the cube, not on a surface alone");
  const std::string of_lines = std::to_string(crossings) + " crossings of " + std::to_string(cast) + " lines";
  if (crossings == 0 ? cast > hopeless_lines : cast > hopeless_lines + most_lines_a_sample * wanted)
    throw_empty("its zero surface has " + of_lines + " through the cube");
  if (function.value_count() > most_values + most_values_a_sample * wanted)
    throw_empty(std::to_string(function.value_count()) + " values found " + of_lines +
                ": it varies like noise, or stays within rounding of 0");
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
  if (model.active().empty())
    throw_empty(model.has_both_sides() ? "its values jump from one sign to the other, with no zero between"
                                       : "its values keep one sign in the whole cube");

  SurfaceSamples samples;
  samples.frame = implicit.frame();
  samples.points.resize(options.count, 3);
  samples.normals.resize(options.count, 3);
  const auto seed = static_cast<std::uint64_t>(options.seed);
  Caster caster(function, model, seed);
  if (model.lipschitz() < least_slope)
    throw_empty("it changes by less than " + number_text(4.0 * least_slope) + " over the whole cube");

  SurfaceNormals normals(function);
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
      require_surface(caster, function, options.count);
    }
    // The choice of crossings must not depend on their positions.
    shuffle(caster.brackets, used, order);
    const auto begin = caster.brackets.begin() + static_cast<std::ptrdiff_t>(used);
    const std::vector<Bracket> chosen(begin, begin + missing);
    used += chosen.size();
    progress.report(0.7, "finding the crossings");
    const Crossings crossings = find_crossings(function, caster.lines, chosen, options.tolerance);
    const Points directions = normals(crossings.points, crossings.gradients);
    for (Index i = 0; i < directions.rows(); ++i) {
      if (directions.row(i).isZero(0.0)) continue;
      samples.points.row(done) = crossings.points.row(i).cast<double>();
      samples.normals.row(done++) = directions.row(i);
    }
    if (static_cast<Index>(used) > fewest_sign_changes && done < static_cast<Index>(used) / share_of_signs)
      throw_empty("its values jump from one sign to the other, or are too steep for single precision");
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
