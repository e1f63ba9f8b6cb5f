// SPDX-License-Identifier: GPL-3.0-or-later
#include "attach/attachment.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <typeinfo>
#include <utility>
#include <vector>

#include "attach/places_above.h"
#include "attach/surface_frames.h"
#include "core/errors.h"
#include "core/jacobians.h"
#include "core/parallel.h"
#include "distance/morton.h"
#include "energies/rotation.h"
#include "fields/radial_evaluator.h"
#include "fields/radial_field.h"
#include "sampling/nearest_sample.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

/// Shares of the body's size: up to the first distance a point moves with the field, from the second with
/// frames.
constexpr double near_share = 0.03, far_share = 0.06;
/// Spacings of the samples within which a point counts as on the surface.
constexpr double surface_spacings = 1.5;
/// Square root of a body's area in its sizes, roughly: for the spacing of samples.
constexpr double area_side = 1.4;
/// Mean influence of nearby frames from which a carried point follows fully.
constexpr double full_influence = 0.5;

/// The part of evaluating radial fields that is the same for all fields of one basis: the basis functions at
/// the points and at the frames. Fields of one live session differ in their coefficients alone.
class CachedEvaluation {
 public:
  CachedEvaluation(const RadialField& field, PointsIn mesh_points, PointsIn frame_points,
                   const SurfaceFrames& frames, const CarriedPoints& carried)
      : field_(field), mesh_points_(mesh_points), frame_points_(frame_points) {
    const Points cube = field.frame().to_cube(mesh_points_);
    points_ = {field.basis(), cube, JetOrder::value};
    at_frames_ = {field.basis(), frame_points, JetOrder::first};
    if (!field.influence()) return;
    point_influence_ = field.influence()->at(cube);
    // Frames blend over long distances: a point does not follow where nothing nearby moves.
    carried_influence_ = carried.nearby_means(frames, field.influence()->at(frame_points));
    for (double& value : carried_influence_) value = smooth_between(0.0, full_influence, value);
  }

  bool matches(const RadialField& field) const { return field.shares_places_with(field_); }

  /// The moved points (n,3) in mesh coordinates; exactly at rest where nothing moves.
  Points moved(const RadialField& field) const {
    RowMatrix<double> displacement = field.coefficients();
    displacement.bottomRows<3>() -= Mat3::Identity();
    Points shifts(mesh_points_.rows(), 3);
    points_.evaluate(displacement, {shifts.data(), shifts.rows(), JetOrder::value});
    Points result(shifts.rows(), 3);
    parallel_for(0, shifts.rows(), 4096, [&](Index first, Index last) {
      for (Index i = first; i < last; ++i) {
        const double influence = point_influence_.size() > 0 ? point_influence_[i] : 1.0;
        result.row(i) = mesh_points_.row(i) + (influence * field_.frame().scale) * shifts.row(i);
      }
    });
    return result;
  }

  /// Factors (far) of the motion of carried points; empty: all 1.
  const Vector& carried_influence() const { return carried_influence_; }

  void evaluate_at_frames(const RadialField& field, JetView<double> jets) const {
    at_frames_.evaluate(field.coefficients(), jets);
    if (field_.influence()) field_.influence()->confine(frame_points_, jets);
  }

 private:
  RadialField field_;  // whatever its coefficients
  Points mesh_points_, frame_points_;
  Vector point_influence_, carried_influence_;  // empty: all 1
  RadialEvaluator<double> points_;
  RadialEvaluator<double> at_frames_;
};

const RadialField* as_radial(const DeformationField& field) {
  return typeid(field) == typeid(RadialField) ? dynamic_cast<const RadialField*>(&field) : nullptr;
}

}  // namespace

class Attachment::State {
 public:
  State(const SurfaceSamples& samples, PointsIn points, const Progress& progress);
  Points positions(const DeformationField& field) const;

  Vector distances_;

 private:
  Points frame_points_in(const Frame& frame) const { return frame.to_cube(frame_.to_mesh(frames_.points())); }
  std::shared_ptr<const CachedEvaluation> cached(const RadialField& field) const;

  Frame frame_;
  std::vector<Index> near_, far_;    // points that the field moves, and that frames move
  Points near_points_, far_points_;  // mesh coordinates, in spatial order
  PlacesAbove places_;               // of the points that the field moves
  Vector frame_weights_;             // (far) of the frames beside the field
  SurfaceFrames frames_;
  Points frame_normals_;
  CarriedPoints carried_;
  mutable std::mutex mutex_;
  mutable std::shared_ptr<const CachedEvaluation> cache_;
};

Attachment::State::State(const SurfaceSamples& samples, PointsIn points, const Progress& progress)
    : frame_(samples.frame) {
  require_samples(samples);
  require(points.allFinite(), "points", "some coordinates are NaN or infinite", "all must be finite");
  const ThreadScope threads;
  const Points placed = frame_.to_cube(points);
  require(placed.allFinite(), "points", "some are too far away", "they must be within reach of the body");
  const double size = body_size(samples.points);
  const double spacing = area_side * size / std::sqrt(static_cast<double>(samples.size()));
  const double near = std::max(near_share * size, surface_spacings * spacing),
               far = near * far_share / near_share;
  const Vector distances = nearest_distances(samples.points, placed, progress);
  distances_ = frame_.scale * distances;
  progress.report(0.3, "distances to the body");
  std::vector<double> weights;
  for (const std::uint32_t i : points.rows() > 0 ? morton_order(placed) : std::vector<std::uint32_t>()) {
    const double weight = smooth_between(near, far, distances[i]);
    if (weight < 1.0) near_.push_back(i);
    if (weight > 0.0) far_.push_back(i), weights.push_back(weight);
  }
  near_points_ = points(near_, Eigen::all);
  places_ = PlacesAbove(samples, placed(near_, Eigen::all), distances(near_), spacing);
  far_points_ = points(far_, Eigen::all);
  frame_weights_ = Eigen::Map<const Vector>(weights.data(), static_cast<Index>(weights.size()));
  if (far_.empty()) return;
  frames_ = SurfaceFrames(samples.points);
  if (samples.normals.rows() == samples.size()) frame_normals_ = samples.normals(frames_.rows(), Eigen::all);
  progress.report(0.5, "frames of the body");
  carried_ = CarriedPoints(frames_, placed(far_, Eigen::all), distances(far_), size);
}

std::shared_ptr<const CachedEvaluation> Attachment::State::cached(const RadialField& field) const {
  {
    const std::lock_guard lock(mutex_);
    if (cache_ && cache_->matches(field)) return cache_;
  }
  auto evaluation = std::make_shared<const CachedEvaluation>(
      field, near_points_, frame_points_in(field.frame()), frames_, carried_);
  const std::lock_guard lock(mutex_);
  return cache_ = std::move(evaluation);
}

Points Attachment::State::positions(const DeformationField& field) const {
  const ThreadScope threads;
  Points result(distances_.size(), 3);
  const RadialField* radial = as_radial(field);
  const auto cache = radial != nullptr ? cached(*radial) : nullptr;
  Points near = cache ? cache->moved(*radial) : field.at(near_points_);
  if (!cache) places_.adjust(field, near);
  for (std::size_t i = 0; i < near_.size(); ++i) result.row(near_[i]) = near.row(i);
  if (far_.empty()) return result;
  const Points frame_points = frame_points_in(field.frame());
  const Index count = frame_points.rows();
  JetBlock<double> jets(count, JetOrder::first);
  if (cache)
    cache->evaluate_at_frames(*radial, jets.view());
  else
    field.evaluate(frame_points, jets.view());
  std::vector<double> rotations(9 * count);
  closest_rotations<double>(jets.view().column(1), count, rotations.data());
  Vector growth;  // of the surface; a radial field's clothes keep their size
  if (!cache && frame_normals_.rows() > 0) {
    growth.resize(count);
    for (Index j = 0; j < count; ++j)
      growth[j] = std::sqrt(
          area_vector(jacobian_at(std::as_const(jets).view(), j), frame_normals_.row(j).transpose()).norm());
  }
  // Differences in the field's own frame, so that a field that moves nothing moves nothing here.
  const Points shifts = (field.frame().scale / frame_.scale) *
                        (Eigen::Map<const Points>(jets.view().data, count, 3) - frame_points);
  Points carried =
      frame_.to_mesh(carried_.moved(frames_, frames_.points() + shifts, rotations.data(), growth));
  for (std::size_t i = 0; i < far_.size(); ++i) {
    const Index row = static_cast<Index>(i);
    if (cache && cache->carried_influence().size() > 0 && cache->carried_influence()[row] < 1.0)
      carried.row(row) =
          far_points_.row(row) + cache->carried_influence()[row] * (carried.row(row) - far_points_.row(row));
    const double weight = frame_weights_[row];
    if (weight < 1.0)
      result.row(far_[i]) += weight * (carried.row(row) - result.row(far_[i]));
    else
      result.row(far_[i]) = carried.row(row);
  }
  return result;
}

Attachment::Attachment(const SurfaceSamples& samples, PointsIn points, const Progress& progress)
    : state_(std::make_unique<State>(samples, points, progress)) {}
Attachment::~Attachment() = default;
Attachment::Attachment(Attachment&&) noexcept = default;

Points Attachment::positions(const DeformationField& field) const { return state_->positions(field); }
Index Attachment::size() const { return state_->distances_.size(); }
const Vector& Attachment::distances() const { return state_->distances_; }

}  // namespace arapfields
