// SPDX-License-Identifier: GPL-3.0-or-later
#include "attach/attachment.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <typeinfo>
#include <utility>
#include <vector>

#include "attach/surface_frames.h"
#include "core/errors.h"
#include "core/jets.h"
#include "core/parallel.h"
#include "distance/morton.h"
#include "energies/rotation.h"
#include "fields/field.h"
#include "fields/radial_evaluator.h"
#include "fields/radial_field.h"
#include "mesh/surface_samples.h"
#include "sampling/nearest_sample.h"
#include "sampling/oriented_points.h"
#include "solve/setup.h"

// Places near a surface, which keep their distance from it as it grows.

namespace arapfields {

/// Points near samples of a surface. A field says where a sample goes and how the surface turns and grows
/// there; a point goes where the samples about it say, on average. Where these contradict each other, as
/// between two limbs that approach, it goes with the field itself, unless that is far off.
class PlacesAbove {
 public:
  PlacesAbove() = default;
  /// Points (n,3) in the samples' cube, their distances (n) to the nearest sample, and the samples' spacing.
  PlacesAbove(const SurfaceSamples& samples, PointsIn points, const Vector& distances, double spacing);

  /// From where the field itself takes the points, (n,3) in mesh coordinates, to where they belong.
  void adjust(const DeformationField& field, Points& moved) const;

 private:
  Frame frame_;
  Points points_;     // those near the surface
  Points samples_;    // (m,3) those about them
  Points normals_;    // (m,3)
  Vector distances_;  // of each point to the nearest sample
  Vector reach_;      // and to the farthest that counts
  double spacing_ = 1.0;
};

namespace {

/// Samples count within a disk about a point's foot: its radius in distances from the surface, and the least
/// and the most of it in spacings.
constexpr double disk = 2.8, least_disk = 1.6, most_disk = 6.4;
/// Distance in spacings below which a sample's weight grows no more.
constexpr double least_spacings = 0.1;
/// Deviation of the samples' answers in distances from the moved surface: up to the first they count alone,
/// from the second the field does.
constexpr double agreement = 0.1, contradiction = 1.0;
/// But where large motions part or join what is near, a field off the surface can be steep: a point that it
/// takes farther from the answers' mean than the first of these distances does not go there, wholly from the
/// second on.
constexpr double steady_above = 1.0, astray = 2.0;

}  // namespace

PlacesAbove::PlacesAbove(const SurfaceSamples& samples, PointsIn points, const Vector& distances,
                         double spacing)
    : frame_(samples.frame), distances_(distances), spacing_(spacing) {
  if (points.rows() == 0 || samples.normals.rows() != samples.size()) return;
  points_ = points;
  const Vector disks = (disk * distances).cwiseMax(least_disk * spacing).cwiseMin(most_disk * spacing);
  reach_ = (distances.cwiseAbs2() + disks.cwiseAbs2()).cwiseSqrt();
  const Vector to_samples = nearest_distances(points_, samples.points);
  const double farthest = reach_.maxCoeff();
  std::vector<Index> about;
  for (Index i = 0; i < samples.size(); ++i)
    if (to_samples[i] <= farthest) about.push_back(i);
  samples_ = samples.points(about, Eigen::all);
  normals_ = samples.normals(about, Eigen::all);
}

void PlacesAbove::adjust(const DeformationField& field, Points& moved) const {
  if (samples_.rows() == 0) return;
  const Frame& frame = field.frame();
  const double unit = frame_.scale / frame.scale;  // of lengths at rest
  JetBlock<double> jets(samples_.rows(), JetOrder::first);
  field.evaluate(frame.to_cube(frame_.to_mesh(samples_)), jets.view());
  const JetView<const double> view = std::as_const(jets).view();
  // x ↦ f(p) + A (x − p): along the surface with the field, along the normal as the root of its area grows.
  std::vector<Mat3> slopes(static_cast<std::size_t>(samples_.rows()));
  Vector growth(samples_.rows());
  parallel_for(0, samples_.rows(), 1024, [&](Index first, Index last) {
    for (Index j = first; j < last; ++j) {
      const Vec3 normal = normals_.row(j).transpose();
      const Mat3 jacobian = jacobian_at(view, j);
      const Vec3 turned = area_vector(jacobian, normal);
      growth[j] = std::sqrt(turned.norm());
      const Vec3 up = growth[j] > 0.0 ? Vec3(turned / growth[j]) : Vec3(Vec3::Zero());
      slopes[j] = unit * (jacobian + (up - jacobian * normal) * normal.transpose());
    }
  });
  const Points own = frame.to_cube(moved);
  const OrientedPoints tree(samples_, normals_);
  parallel_for(0, points_.rows(), 64, [&](Index first, Index last) {
    std::vector<Vec3> answers;
    std::vector<double> weights;
    for (Index i = first; i < last; ++i) {
      const Vec3 point = points_.row(i).transpose();
      answers.clear(), weights.clear();
      const double outside = 1.0 / (reach_[i] * reach_[i]);
      double total = 0.0, grown = 0.0;
      Vec3 mean = Vec3::Zero();
      for (const Index j : tree.within(point, reach_[i])) {
        const Vec3 offset = point - samples_.row(j).transpose();
        const double distance = std::max(offset.norm(), least_spacings * spacing_);
        const double kernel = std::max(1.0 / (distance * distance) - outside, 0.0);
        weights.push_back(kernel * std::sqrt(kernel));
        answers.push_back(Eigen::Map<const Vec3>(view.at(0, j)) + slopes[j] * offset);
        total += weights.back();
        grown += weights.back() * growth[j];
        mean += weights.back() * answers.back();
      }
      if (!(total > 0.0)) continue;
      mean /= total;
      double deviation = 0.0;
      for (std::size_t k = 0; k < answers.size(); ++k)
        deviation += weights[k] * (answers[k] - mean).squaredNorm();
      const double height = unit * grown / total * distances_[i];
      const double apart = std::sqrt(deviation / total);
      if (!(height > 0.0)) continue;
      const double off = (mean.transpose() - own.row(i)).norm();
      const double share = std::max(1.0 - smooth_between(agreement, contradiction, apart / height),
                                    smooth_between(steady_above, astray, off / height));
      moved.row(i) += share * frame.scale * (mean.transpose() - own.row(i));
    }
  });
}

namespace {

/// Shares of the body's size: up to the first distance a point moves with the field, from the second with
/// frames.
constexpr double near_share = 0.03, far_share = 0.06;
/// Off the surface a radial field can be steep, as under a style. Where it stretches the way from a frame to
/// what is above it by more than the first factor, both distances shrink, from the second on by `narrowest`.
constexpr double steady = 1.5, steep = 3.0, narrowest = 3.0;
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

/// Points that frames move, and how far they are from the surface.
struct Framed {
  std::vector<Index> rows;
  Points points;  // mesh coordinates
  Vector distances;
  CarriedPoints carried;
};

struct FrameMotion {
  Points positions;
  std::vector<double> rotations;
  Vector growth;  // empty: all 1
};

}  // namespace

class Attachment::State {
 public:
  State(const SurfaceSamples& samples, PointsIn points, const Progress& progress);
  Points positions(const DeformationField& field) const;

  Vector distances_;

 private:
  Points frame_points_in(const Frame& frame) const { return frame.to_cube(frame_.to_mesh(frames_.points())); }
  std::shared_ptr<const CachedEvaluation> cached(const RadialField& field) const;
  Vector steepness(const Points& probed, const Points& frames) const;
  void blend(const Framed& some, const FrameMotion& frames, const Vector& steep_at, const Vector& influence,
             Points& result) const;

  Frame frame_;
  double near_reach_ = 0.0, far_reach_ = 0.0;
  std::vector<Index> near_;  // points that the field moves, in spatial order
  Points near_points_;       // mesh coordinates
  Points probed_;            // these, then what is above the frames, in both distances
  PlacesAbove places_;       // of the points that the field moves
  SurfaceFrames frames_;
  Points frame_normals_;
  Framed far_, close_;  // moved by frames everywhere, and only where the field is steep
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
  near_reach_ = std::max(near_share * size, surface_spacings * spacing);
  far_reach_ = near_reach_ * far_share / near_share;
  const Vector distances = nearest_distances(samples.points, placed, progress);
  distances_ = frame_.scale * distances;
  progress.report(0.3, "distances to the body");
  for (const std::uint32_t i : points.rows() > 0 ? morton_order(placed) : std::vector<std::uint32_t>()) {
    const double weight = smooth_between(near_reach_, far_reach_, distances[i]);
    if (weight < 1.0) near_.push_back(i);
    if (weight > 0.0) far_.rows.push_back(i);
    if (weight <= 0.0 && narrowest * distances[i] > near_reach_) close_.rows.push_back(i);
  }
  near_points_ = points(near_, Eigen::all);
  places_ = PlacesAbove(samples, placed(near_, Eigen::all), distances(near_), spacing);
  probed_ = near_points_;
  if (far_.rows.empty() && close_.rows.empty()) return;
  frames_ = SurfaceFrames(samples.points);
  if (samples.normals.rows() == samples.size()) frame_normals_ = samples.normals(frames_.rows(), Eigen::all);
  progress.report(0.5, "frames of the body");
  for (Framed* some : {&far_, &close_}) {
    some->points = points(some->rows, Eigen::all);
    some->distances = distances(some->rows);
    some->carried = CarriedPoints(frames_, placed(some->rows, Eigen::all), some->distances, size);
  }
  if (near_.empty() || frame_normals_.rows() == 0) return;
  const Points& from = frames_.points();
  probed_.resize(near_points_.rows() + 2 * from.rows(), 3);
  probed_ << near_points_, frame_.to_mesh(from + near_reach_ * frame_normals_),
      frame_.to_mesh(from + far_reach_ * frame_normals_);
}

std::shared_ptr<const CachedEvaluation> Attachment::State::cached(const RadialField& field) const {
  {
    const std::lock_guard lock(mutex_);
    if (cache_ && cache_->matches(field)) return cache_;
  }
  auto evaluation = std::make_shared<const CachedEvaluation>(field, probed_, frame_points_in(field.frame()),
                                                             frames_, far_.carried);
  const std::lock_guard lock(mutex_);
  return cache_ = std::move(evaluation);
}

/// How steep a field is above each frame, from 0 to 1; empty: nowhere. From where it takes `probed_`, in mesh
/// coordinates, and the frames, in the cube.
Vector Attachment::State::steepness(const Points& probed, const Points& frames) const {
  const Index count = frames.rows(), first = near_points_.rows();
  if (probed.rows() == first) return {};
  const Points above = frame_.to_cube(probed.bottomRows(2 * count));
  const Vector near = (above.topRows(count) - frames).rowwise().norm() / near_reach_;
  const Vector far = (above.bottomRows(count) - frames).rowwise().norm() / far_reach_;
  Vector steep_at(count);
  for (Index j = 0; j < count; ++j) steep_at[j] = smooth_between(steady, steep, std::max(near[j], far[j]));
  return steep_at.maxCoeff() > 0.0 ? steep_at : Vector();
}

/// Moves points towards where the frames take them: by their distance, where the field is steep a greater
/// one.
void Attachment::State::blend(const Framed& some, const FrameMotion& frames, const Vector& steep_at,
                              const Vector& influence, Points& result) const {
  Points carried =
      frame_.to_mesh(some.carried.moved(frames_, frames.positions, frames.rotations.data(), frames.growth));
  const Vector narrower = steep_at.size() > 0 ? some.carried.means(steep_at) : Vector();
  for (std::size_t i = 0; i < some.rows.size(); ++i) {
    const Index row = static_cast<Index>(i);
    if (influence.size() > 0 && influence[row] < 1.0)
      carried.row(row) = some.points.row(row) + influence[row] * (carried.row(row) - some.points.row(row));
    const double factor = narrower.size() > 0 ? 1.0 + (narrowest - 1.0) * narrower[row] : 1.0;
    const double weight = smooth_between(near_reach_, far_reach_, factor * some.distances[row]);
    if (weight < 1.0)
      result.row(some.rows[i]) += weight * (carried.row(row) - result.row(some.rows[i]));
    else
      result.row(some.rows[i]) = carried.row(row);
  }
}

Points Attachment::State::positions(const DeformationField& field) const {
  const ThreadScope threads;
  Points result(distances_.size(), 3);
  const RadialField* radial = as_radial(field);
  const auto cache = radial != nullptr ? cached(*radial) : nullptr;
  Points near = cache ? cache->moved(*radial) : field.at(near_points_);
  if (!cache) places_.adjust(field, near);
  for (std::size_t i = 0; i < near_.size(); ++i) result.row(near_[i]) = near.row(i);
  if (frames_.points().rows() == 0) return result;
  const Points frame_points = frame_points_in(field.frame());
  const Index count = frame_points.rows();
  JetBlock<double> jets(count, JetOrder::first);
  if (cache)
    cache->evaluate_at_frames(*radial, jets.view());
  else
    field.evaluate(frame_points, jets.view());
  FrameMotion frames;
  frames.rotations.resize(9 * count);
  closest_rotations<double>(jets.view().column(1), count, frames.rotations.data());
  if (!cache && frame_normals_.rows() > 0) {  // a radial field's clothes keep their size
    frames.growth.resize(count);
    for (Index j = 0; j < count; ++j)
      frames.growth[j] = std::sqrt(
          area_vector(jacobian_at(std::as_const(jets).view(), j), frame_normals_.row(j).transpose()).norm());
  }
  // Differences in the field's own frame, so that a field that moves nothing moves nothing here.
  frames.positions =
      frames_.points() + (field.frame().scale / frame_.scale) *
                             (Eigen::Map<const Points>(jets.view().data, count, 3) - frame_points);
  const Vector influence = cache ? cache->carried_influence() : Vector();
  const Vector steep_at = cache && influence.size() == 0 ? steepness(near, frames.positions) : Vector();
  blend(far_, frames, steep_at, influence, result);
  if (steep_at.size() > 0) blend(close_, frames, steep_at, {}, result);
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
