// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/live_solver.h"

#include <cmath>
#include <string>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/random.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

/// Samples that the bumps' centers are chosen from.
constexpr Index center_candidates = 6000;
/// Weight, against the surface's energy, with which a style without handles holds the lowest sample in place.
constexpr double anchor_weight = 1.0;

/// Samples × bumps below which a step takes about a millisecond: waking other threads, which may be busy with
/// drawing, would cost more than they do.
constexpr Index worth_threads = 1000000;

template <class Number>
void require_range(const char* name, Number value, double low, double high) {
  require(std::isfinite(static_cast<double>(value)) && value >= low && value <= high, name,
          std::to_string(value),
          "from " + std::to_string(low) + " to " + std::to_string(high) + " is allowed");
}

/// `count` different numbers below n in random order (all of them where n is not larger).
std::vector<Index> random_subset(Index n, Index count, Random& random) {
  std::vector<Index> all(static_cast<std::size_t>(n));
  for (Index i = 0; i < n; ++i) all[static_cast<std::size_t>(i)] = i;
  const Index taken = std::min(n, count);
  for (Index i = 0; i < taken; ++i)
    std::swap(all[static_cast<std::size_t>(i)], all[static_cast<std::size_t>(i + random.below(n - i))]);
  all.resize(static_cast<std::size_t>(taken));
  return all;
}

/// One random entry of each of `count` equal parts of the list: even coverage where the list is in spatial
/// order.
std::vector<Index> stratified(const std::vector<Index>& list, Index count, Random& random) {
  const Index n = static_cast<Index>(list.size()), taken = std::min(n, count);
  std::vector<Index> result;
  for (Index i = 0; i < taken; ++i) {
    const Index begin = i * n / taken, end = (i + 1) * n / taken;
    result.push_back(list[static_cast<std::size_t>(begin + random.below(end - begin))]);
  }
  return result;
}

Points rows_of(PointsIn points, const std::vector<Index>& rows) {
  Points result(static_cast<Index>(rows.size()), 3);
  for (std::size_t i = 0; i < rows.size(); ++i) result.row(static_cast<Index>(i)) = points.row(rows[i]);
  return result;
}

}  // namespace

void LiveOptions::validate() const {
  require_range("samples", samples, 10, 1e6);
  require_range("coarse_bumps", coarse_bumps, 0, 3000);
  require_range("fine_bumps", fine_bumps, 1, 3000);
  require_range("coarse_reach", coarse_reach, 0.5, 20);
  require_range("fine_reach", fine_reach, 0.5, 20);
  require_range("bending", bending, 0, 1e3);
  require_range("handle_weight", handle_weight, 1e-6, 1e9);
  require_range("handle_samples", handle_samples, 1, 1e6);
  require_range("steps", steps, 1, 1e6);
  require_range("tolerance", tolerance, 0, 1);
  require_range("gauss_weight", gauss_weight, 0, 1e6);
  require_range("threads", threads, 0, 1024);
}

LiveSolver::LiveSolver(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                       const LiveOptions& options, const Progress& progress)
    : options_(options), frame_(samples.frame), surface_(samples.points), surface_normals_(samples.normals) {
  options.validate();
  require_samples(samples);
  const Stopwatch watch;
  const ThreadScope threads(options.threads);
  Random random(static_cast<std::uint64_t>(options.seed));
  const std::vector<Index> order = spatial_order(surface_);
  chosen_ = stratified(order, options.samples, random);
  const std::vector<Index> candidates = stratified(order, center_candidates, random);
  std::vector<RadialScale> scales;
  if (options.coarse_bumps > 0) scales.push_back({options.coarse_bumps, options.coarse_reach});
  scales.push_back({options.fine_bumps, options.fine_reach});
  basis_ = radial_basis(rows_of(surface_, candidates), scales);
  progress.report(0.2, "bumps placed");
  objective_ = std::make_unique<LiveObjective>(basis_, rows_of(surface_, chosen_), options.bending,
                                               options.handle_weight);
  progress.report(0.8, "stiffness");
  coefficients_ = basis_.identity();
  set_handles(handles);
  report_.setup_seconds = watch.seconds();
}

void LiveSolver::set_handles(const std::vector<Handle>& handles) {
  const ThreadScope threads(options_.threads);
  BoundHandles bound(in_cube(handles, frame_), surface_);
  HandleBatch<double> pairs;
  pair_rows_.clear();
  if (handles.empty()) {
    Index lowest = 0;
    surface_.col(2).minCoeff(&lowest);
    pairs = {surface_.row(lowest), surface_.row(lowest),
             Vector::Constant(1, anchor_weight / options_.handle_weight)};
  } else {
    Random random(static_cast<std::uint64_t>(options_.seed), 1);
    std::vector<double> weights;
    for (Index i = 0; i < bound.count(); ++i) {
      const std::vector<Index> rows =
          random_subset(bound.begin(i + 1) - bound.begin(i), options_.handle_samples, random);
      for (const Index row : rows) {
        pair_rows_.push_back(bound.begin(i) + row);
        weights.push_back(bound.handle(i).weight /
                          static_cast<double>(static_cast<Index>(rows.size()) * bound.count()));
      }
    }
    pairs = {rows_of(bound.sources(), pair_rows_), rows_of(bound.targets(), pair_rows_),
             Eigen::Map<const Vector>(weights.data(), static_cast<Index>(weights.size()))};
  }
  objective_->set_handles(std::move(pairs));
  bound_ = std::move(bound);
  handles_ = handles;
  optimizer_.forget();
}

void LiveSolver::set_targets(const std::vector<Handle>& moved) {
  bound_.retarget(in_cube(moved, frame_));
  for (std::size_t i = 0; i < handles_.size(); ++i) {
    handles_[i].target = moved[i].target;
    handles_[i].target_point = moved[i].target_point;
  }
  if (!handles_.empty()) objective_->set_targets(rows_of(bound_.targets(), pair_rows_));
}

void LiveSolver::set_style(PointsIn preferred, double strength, double sharpness, const Vector& weights) {
  require_range("strength", strength, 0, 1e6);
  require(
      weights.size() == 0 ||
          (weights.size() == surface_.rows() && weights.allFinite() && weights.minCoeff() >= 0),
      "weights", std::to_string(weights.size()) + " numbers, or negative or non-finite ones",
      "one weight ≥ 0 for each of the " + std::to_string(surface_.rows()) + " samples, or none, is needed");
  if (strength == 0.0) return clear_style();
  require(surface_normals_.rows() == surface_.rows(), "samples", "they have no normals",
          "a style needs samples with normals");
  LiveStyle style{gauss_preference(preferred, sharpness),
                  rows_of(surface_normals_, chosen_),
                  {},
                  strength * options_.gauss_weight};
  if (weights.size() > 0) {
    style.sample_weights.resize(static_cast<Index>(chosen_.size()));
    for (std::size_t i = 0; i < chosen_.size(); ++i)
      style.sample_weights[static_cast<Index>(i)] = weights[chosen_[i]];
  }
  objective_->set_style(std::move(style));
  styled_ = true;
  optimizer_.forget();
}

void LiveSolver::clear_style() {
  objective_->set_style(std::nullopt);
  styled_ = false;
  optimizer_.forget();
}

int LiveSolver::solve_threads() const {
  const Index work = static_cast<Index>(chosen_.size()) * basis_.bumps();
  return options_.threads == 0 && work < worth_threads ? 1 : options_.threads;
}

std::shared_ptr<RadialField> LiveSolver::solve(Index steps, double tolerance, const Progress& progress) {
  const ThreadScope threads(solve_threads());
  const Stopwatch watch;
  const QuasiNewtonReport found = optimizer_.minimise(
      *objective_, {steps > 0 ? steps : options_.steps, tolerance > 0.0 ? tolerance : options_.tolerance},
      coefficients_, progress);
  report_.steps = found.steps;
  report_.evaluations = found.evaluations;
  report_.converged = found.converged;
  report_.value = found.value;
  measure(watch.seconds());
  return field();
}

void LiveSolver::measure(double seconds) {
  Vector u;
  objective_->measure(coefficients_, u);
  const LiveTerms terms = objective_->terms(u);
  report_.arap = terms.arap;
  report_.energy = terms.arap.stretch + options_.bending * terms.arap.bend;
  report_.preference.reset();
  if (styled_) report_.preference = 1.0 - terms.gauss;
  report_.distortion = distortion<double>(objective_->jets(u));
  const HandleError error = objective_->handle_distance(u);
  report_.handle_mean = error.mean * frame_.scale;
  report_.handle_max = error.max * frame_.scale;
  report_.seconds = seconds;
}

void LiveSolver::reset() {
  coefficients_ = basis_.identity();
  optimizer_.forget();
  std::vector<Handle> at_rest = handles_;
  for (Handle& handle : at_rest) {
    handle.target = handle.rest;
    handle.target_point = handle.rest_point;
  }
  set_targets(at_rest);
  const double setup = report_.setup_seconds;
  report_ = {};
  report_.setup_seconds = setup;
}

std::shared_ptr<RadialField> LiveSolver::field() const {
  auto result = std::make_shared<RadialField>(basis_, coefficients_);
  result->set_frame(frame_);
  result->set_rest_points(rows_of(surface_, chosen_));
  return result;
}

}  // namespace arapfields
