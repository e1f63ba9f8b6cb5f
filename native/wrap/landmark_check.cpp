// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/landmark_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "core/errors.h"
#include "sampling/sample_choice.h"
#include "wrap/flow.h"
#include "wrap/parameters.h"

namespace arapfields {
namespace {

// All distances are fractions of the target's diagonal.

/// Fewest pairs among which outliers can be found, and the largest fraction of outliers.
constexpr Index least_pairs = 4;
constexpr double most_wrong = 0.4;
/// Most triples, rounds of iteratively reweighted least squares for each, and the largest factor between the
/// scale of a triple's similarity and the ratio of the shapes' sizes.
constexpr Index most_triples = 600;
constexpr int reweightings = 3;
constexpr double scale_range = 3.0;
/// Scale of the robust penalty d²/(d² + half_distance²) (Geman, McClure 1987).
constexpr double half_distance = 0.15;
/// Candidate similarities that are tried: their number, the least difference of some pair's distance between
/// two of them, and the bounds of their penalty, relative and absolute, above that of the best.
constexpr std::size_t most_placements = 3;
constexpr double differ = 0.1, worse_factor = 1.3, worse = 0.2;
/// If the best similarity brings all pairs within this distance, there are no outliers.
constexpr double no_doubt = 0.05;
/// A pair is an outlier if its distance exceeds `medians` medians, clamped to these bounds (tuned).
constexpr double medians = 2.5, least_far = 0.08, most_far = 0.13;
/// An outlier is an inlier again if a wrap without it brings it within this distance.
constexpr double near_anyway = 0.03;
/// take_back(): a pair farther than `may_return` is not tried. It returns if the high weight brings it within
/// `medians` medians or near_anyway and lets the stretch grow at most by the factor more_stretch plus
/// least_stretch; or within least_far, where the stretch falls to the fraction `relaxed`. The bounds lie
/// halfway between right and wrong pairs of the tests' shapes: of those that stretch little, right ones come
/// within 0.021, wrong ones stay beyond 0.043; the stretch falls to 0.7 with right ones of bent parts, never
/// below 0.95 with wrong ones. Rounding moves both by a fiftieth.
constexpr double more_stretch = 1.1, least_stretch = 0.02, may_return = 0.35, relaxed = 0.8;
/// Most rounds of wraps from one similarity, and the factor by which a mirror image must fit better.
constexpr int rounds = 4;
constexpr double mirrored_gain = 2.0;
/// Options of the coarse wrap, its low and high factors on the landmark weight, and its target's samples.
constexpr int coarse_centers = 100, coarse_stages = 3, coarse_iterations = 3;
constexpr double soft_pull = 0.3, firm_pull = 2.0;
constexpr Index coarse_target_samples = 3000;

/// Sum of the robust penalties of distances, each below 1.
double penalty(const Vector& distances) {
  const auto squares = distances.array().square();
  return (squares / (squares + half_distance * half_distance)).sum();
}

struct Placement {
  double score = std::numeric_limits<double>::infinity();
  Similarity similarity;
  Vector distances;
};

std::vector<std::array<Index, 3>> triples(Index count, std::uint64_t seed) {
  std::vector<std::array<Index, 3>> result;
  if (count * (count - 1) * (count - 2) <= 6 * most_triples) {
    for (Index a = 0; a < count; ++a)
      for (Index b = a + 1; b < count; ++b)
        for (Index c = b + 1; c < count; ++c) result.push_back({a, b, c});
    return result;
  }
  Random random(seed);
  for (Index k = 0; k < most_triples; ++k) {
    const std::vector<Index> rows = random_subset(count, 3, random);
    result.push_back({rows[0], rows[1], rows[2]});
  }
  return result;
}

/// Similarities from triples, refined with all pairs, in ascending order of their penalties.
std::vector<Placement> placements(const WrapSource& source, const WrapTarget& target, double scale,
                                  std::uint64_t seed, const Progress& progress) {
  const double size = gyration(target.points) / gyration(source.points);
  std::vector<Placement> result;
  for (const std::array<Index, 3>& triple : triples(source.landmarks.rows(), seed)) {
    Vector weights = Vector::Zero(source.landmarks.rows());
    for (const Index row : triple) weights[row] = 1.0;
    Placement placed;
    for (int round = 0; round <= reweightings; ++round) {
      placed.similarity = fitted_similarity(source.landmarks, source.landmark_targets, weights, scale);
      placed.distances = source.distances(placed.similarity) / target.diagonal;
      if (round == 0 && std::abs(std::log(placed.similarity.scale / size)) > std::log(scale_range)) break;
      weights = (1.0 + (placed.distances / half_distance).array().square()).square().inverse();
      if (round == reweightings) placed.score = penalty(placed.distances);
    }
    if (std::isfinite(placed.score)) result.push_back(std::move(placed));
    progress.check();
  }
  std::ranges::stable_sort(result, {}, &Placement::score);
  return result;
}

std::vector<Placement> distinct(const std::vector<Placement>& all) {
  std::vector<Placement> result;
  for (const Placement& placed : all) {
    if (!result.empty() && placed.score > worse_factor * result[0].score + worse) break;
    if (std::ranges::all_of(result, [&](const Placement& other) {
          return (placed.distances - other.distances).cwiseAbs().maxCoeff() > differ;
        }))
      result.push_back(placed);
    if (result.size() == most_placements) break;
  }
  return result;
}

/// Results of a coarse wrap that uses some pairs as landmarks.
struct Trial {
  Vector distances;  // of all pairs
  double stretch = 0.0;
};

/// Classifies pairs by coarse wraps, and keeps the best result over several initial similarities.
class Vote {
 public:
  Vote(const SurfaceSamples& samples, const WrapSource& source, const WrapTarget& target,
       const WrapOptions& options, const Progress& progress)
      : samples_(samples),
        source_(source),
        target_(target.subsample(coarse_target_samples)),
        options_(options),
        progress_(progress),
        fewest_(std::max<Index>(
            3, std::lround(std::ceil((1.0 - most_wrong) * static_cast<double>(source.landmarks.rows()))))) {
    options_.centers = coarse_centers;
    options_.stages = coarse_stages;
    options_.iterations = coarse_iterations;
  }

  void from(const Similarity& start, double scale, bool is_fixed) {
    std::vector<Index> kept(source_.landmarks.rows());
    std::iota(kept.begin(), kept.end(), 0);
    Similarity at = start;
    Trial trial;
    bool are_enough = true;
    for (int round = 0; round < rounds; ++round) {
      trial = tried(at, kept, soft_pull);
      std::vector<Index> near = near_of(trial, kept);
      are_enough = static_cast<Index>(near.size()) >= fewest_;
      if (!are_enough) near = nearest_of(trial);
      const bool is_done = near == kept;
      kept = std::move(near);
      if (is_done) break;
      if (!is_fixed) at = fit(kept, scale);
    }
    if (!are_enough) return;
    take_back(at, kept, trial);
    const double score = penalty(trial.distances);
    if (score >= score_) return;
    score_ = score;
    kept_ = std::move(kept);
    last_ = std::move(trial);
  }

  /// The inliers; none if there are too few.
  const std::optional<std::vector<Index>>& kept() const { return kept_; }
  /// Distances of all pairs after the wrap with the inliers.
  const Vector& distances() const { return last_.distances; }

 private:
  Trial tried(const Similarity& at, const std::vector<Index>& pulled, double pull) const {
    const WrapTarget placed = target_.transformed_back(at);
    WrapFlow flow(samples_, placed, source_.landmarks, at.inverse_of(source_.landmark_targets),
                  {pulled, wrap_parameters::landmark_weight.first * pull},
                  static_cast<std::uint64_t>(options_.seed));
    flow.run(options_, progress_, {}, coarse_sliding);
    return {(at.of(flow.landmarks()) - source_.landmark_targets).rowwise().norm() / target_.diagonal,
            flow.stretch()};
  }
  Similarity fit(const std::vector<Index>& rows, double scale) const {
    const WrapSource some = source_.with_landmarks(rows);
    return fitted_similarity(some.landmarks, some.landmark_targets,
                             Vector::Ones(static_cast<Index>(rows.size())), scale);
  }
  /// The pairs with the smallest distances, as many as there must be inliers.
  std::vector<Index> nearest_of(const Trial& trial) const {
    std::vector<Index> result(trial.distances.size());
    std::iota(result.begin(), result.end(), 0);
    std::ranges::stable_sort(result, {}, [&](Index row) { return trial.distances[row]; });
    result.resize(fewest_);
    std::ranges::sort(result);
    return result;
  }
  /// `medians` times the median distance of the landmarks in use.
  static double spread(const Trial& trial, const std::vector<Index>& pulled) {
    std::vector<double> sorted;
    for (const Index row : pulled) sorted.push_back(trial.distances[row]);
    std::ranges::sort(sorted);
    return medians * (sorted[(sorted.size() - 1) / 2] + sorted[sorted.size() / 2]) / 2.0;
  }
  static double limit(const Trial& trial, const std::vector<Index>& pulled) {
    return std::clamp(spread(trial, pulled), least_far, most_far);
  }
  static std::vector<Index> near_of(const Trial& trial, const std::vector<Index>& pulled) {
    std::vector<Index> result;
    const double far = limit(trial, pulled);
    for (Index row = 0; row < trial.distances.size(); ++row)
      if (trial.distances[row] < (std::ranges::binary_search(pulled, row) ? far : near_anyway))
        result.push_back(row);
    return result;
  }

  /// Returns outliers one by one to the inliers if a wrap with the high landmark weight reaches them with
  /// little more stretch, or relaxes the surface. A wrong pair would do neither.
  void take_back(const Similarity& at, std::vector<Index>& kept, Trial& trial) const {
    std::vector<Index> candidates;
    for (Index row = 0; row < trial.distances.size(); ++row)
      if (!std::ranges::binary_search(kept, row) && trial.distances[row] < may_return)
        candidates.push_back(row);
    if (candidates.empty()) return;
    std::ranges::sort(candidates, {}, [&](Index row) { return trial.distances[row]; });
    trial = tried(at, kept, firm_pull);
    for (const Index row : candidates) {
      std::vector<Index> more = kept;
      more.insert(std::ranges::upper_bound(more, row), row);
      Trial with = tried(at, more, firm_pull);
      const double far = limit(with, more);
      const bool is_cheap = with.stretch <= more_stretch * trial.stretch + least_stretch;
      const bool is_relaxed = with.stretch <= relaxed * trial.stretch;
      if (!is_cheap ||
          with.distances[row] >= std::max(is_relaxed ? least_far : near_anyway, spread(with, more)) ||
          std::ranges::any_of(more, [&](Index one) { return with.distances[one] >= far; }))
        continue;
      kept = std::move(more);
      trial = std::move(with);
    }
  }

  const SurfaceSamples& samples_;
  const WrapSource& source_;
  WrapTarget target_;
  WrapOptions options_;
  Progress progress_;
  Index fewest_;
  double score_ = std::numeric_limits<double>::infinity();
  std::optional<std::vector<Index>> kept_;
  Trial last_;
};

WrapSource mirrored(WrapSource source) {
  source.landmarks.col(0) *= -1.0;
  return source;
}

}  // namespace

LandmarkVerdict trusted_landmarks(const SurfaceSamples& samples, const WrapSource& source,
                                  const WrapTarget& target, const WrapOptions& options,
                                  std::vector<std::string>& warnings, const Progress& progress) {
  const Index count = source.landmarks.rows();
  LandmarkVerdict verdict;
  verdict.kept.resize(count);
  std::iota(verdict.kept.begin(), verdict.kept.end(), 0);
  if (!options.check_landmarks || count < least_pairs) return verdict;
  const bool is_fixed = options.alignment == AlignmentKind::none;
  const double scale = options.alignment == AlignmentKind::similar ? 0.0 : source.frame.scale;
  const auto seed = static_cast<std::uint64_t>(options.seed);

  std::vector<Placement> starts;
  if (is_fixed) {
    starts.push_back({0.0, {scale, Mat3::Identity(), source.frame.center}, {}});
  } else {
    starts = placements(source, target, scale, seed, progress);
    const std::vector<Placement> turned = placements(mirrored(source), target, scale, seed, progress);
    if (starts.empty()) return verdict;
    require(turned.empty() || starts[0].distances.mean() <= no_doubt ||
                mirrored_gain * turned[0].score > starts[0].score,
            "landmarks", "they ask for a mirror image", "left and right are exchanged in them");
    if (starts[0].distances.maxCoeff() <= no_doubt) return verdict;
    starts = distinct(starts);
  }

  Vote vote(samples, source, target, options, progress);
  for (const Placement& start : starts) {
    vote.from(start.similarity, scale, is_fixed);
    if (vote.kept() == verdict.kept) break;
  }
  if (!vote.kept()) {
    warnings.emplace_back(
        "the landmarks contradict each other, too many of them to say which are wrong; the result may be "
        "badly stretched");
    return verdict;
  }
  verdict.kept = *vote.kept();
  for (Index row = 0; row < count; ++row)
    if (!std::ranges::binary_search(verdict.kept, row)) {
      verdict.left_out.push_back(row);
      warnings.push_back(landmark_name(row) + " contradicts the others and was left out: they take it " +
                         percent_text(vote.distances()[row]) + " of the target's size from its place");
    }
  return verdict;
}

}  // namespace arapfields
