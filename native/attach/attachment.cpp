// SPDX-License-Identifier: GPL-3.0-or-later
#include "attach/attachment.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <typeinfo>
#include <vector>

#include "attach/carrier_frames.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "distance/morton.h"
#include "energies/rotation.h"
#include "fields/radial_evaluator.h"
#include "fields/radial_field.h"
#include "sampling/nearest_sample.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

/// Shares of the size up to which the field alone, and from which frames alone carry a point; and the gaps
/// between samples within which a point may lie on the surface.
constexpr double near_share = 0.03, far_share = 0.06, gaps = 1.5;
/// A surface by its size: an order of magnitude is enough.
constexpr double area_side = 1.4;
/// Of a fall-off: where what is close by moves as far as this on average, what is carried moves all the way.
constexpr double half_moved = 0.5;

/// What of a radial field does not change from shape to shape: all but its coefficients, and what these
/// multiply at the points and at the places of frames.
class RadialSites {
 public:
  RadialSites(const RadialField& field, PointsIn mesh_points, PointsIn places, const CarrierFrames& frames,
              const CarriedPoints& carried)
      : basis_(field.basis()),
        frame_(field.frame()),
        influence_(field.influence()),
        mesh_points_(mesh_points) {
    const Points cube = frame_.to_cube(mesh_points_);
    points_ = {basis_, cube, JetOrder::value};
    places_ = places;
    at_places_ = {basis_, places, JetOrder::first};
    if (!influence_) return;
    shares_ = influence_->at(cube);
    // Frames reach far: where nothing close by moves, what they carry does not move either.
    carried_shares_ = carried.means_close_by(frames, influence_->at(places));
    for (double& share : carried_shares_) share = smooth_between(0.0, half_moved, share);
  }

  bool fit(const RadialField& field) const {
    return field.basis().embedding == basis_.embedding && field.frame() == frame_ &&
           field.influence() == influence_ && field.basis().center_count() == basis_.center_count() &&
           field.basis().radii == basis_.radii && field.basis().centers == basis_.centers;
  }

  /// The points' places (n,3), mesh coordinates; exactly at rest where nothing moves.
  Points moved(const RadialField& field) const {
    RowMatrix<double> shifts = field.coefficients();
    shifts.bottomRows<3>() -= Mat3::Identity();
    Points found(mesh_points_.rows(), 3);
    points_.evaluate(shifts, {found.data(), found.rows(), JetOrder::value});
    Points result(found.rows(), 3);
    parallel_for(0, found.rows(), 4096, [&](Index first, Index last) {
      for (Index i = first; i < last; ++i) {
        const double share = shares_.size() > 0 ? shares_[i] : 1.0;
        result.row(i) = mesh_points_.row(i) + (share * frame_.scale) * found.row(i);
      }
    });
    return result;
  }

  /// Of the motion of what frames carry, (far); empty: all of it.
  const Vector& carried_shares() const { return carried_shares_; }

  void evaluate_at_places(const RadialField& field, JetView<double> jets) const {
    at_places_.evaluate(field.coefficients(), jets);
    if (influence_) influence_->confine(places_, jets);
  }

 private:
  RadialBasis basis_;
  Frame frame_;
  std::shared_ptr<const Influence> influence_;
  Points mesh_points_, places_;
  Vector shares_, carried_shares_;  // of the motion; empty: all of it
  RadialEvaluator<double> points_;
  RadialEvaluator<double> at_places_;
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
  Points places_in(const Frame& frame) const { return frame.to_cube(frame_.to_mesh(frames_.places())); }
  std::shared_ptr<const RadialSites> sites_of(const RadialField& field) const;

  Frame frame_;
  std::vector<Index> near_, far_;    // points that the field, and that frames, have a part in
  Points near_points_, far_points_;  // mesh coordinates, neighbours beside each other
  Vector far_shares_;                // (far) of the frames
  CarrierFrames frames_;
  CarriedPoints carried_;
  mutable std::mutex mutex_;
  mutable std::shared_ptr<const RadialSites> sites_;
};

Attachment::State::State(const SurfaceSamples& samples, PointsIn points, const Progress& progress)
    : frame_(samples.frame) {
  require_samples(samples);
  require(points.allFinite(), "points", "some coordinates are NaN or infinite", "all must be finite");
  const ThreadScope threads;
  const Points placed = frame_.to_cube(points);
  require(placed.allFinite(), "points", "some are too far away", "they must be within reach of the body");
  const double size = body_size(samples.points);
  const double gap = area_side * size / std::sqrt(static_cast<double>(samples.size()));
  const double near = std::max(near_share * size, gaps * gap), far = near * far_share / near_share;
  const Vector distances = nearest_distances(samples.points, placed, progress);
  distances_ = frame_.scale * distances;
  progress.report(0.3, "distances to the body");
  std::vector<double> shares;
  for (const std::uint32_t i : points.rows() > 0 ? morton_order(placed) : std::vector<std::uint32_t>()) {
    const double share = smooth_between(near, far, distances[i]);
    if (share < 1.0) near_.push_back(i);
    if (share > 0.0) far_.push_back(i), shares.push_back(share);
  }
  near_points_ = points(near_, Eigen::all);
  far_points_ = points(far_, Eigen::all);
  far_shares_ = Eigen::Map<const Vector>(shares.data(), static_cast<Index>(shares.size()));
  if (far_.empty()) return;
  frames_ = CarrierFrames(samples.points);
  progress.report(0.5, "frames of the body");
  carried_ = CarriedPoints(frames_, placed(far_, Eigen::all), distances(far_), size);
}

std::shared_ptr<const RadialSites> Attachment::State::sites_of(const RadialField& field) const {
  {
    const std::lock_guard lock(mutex_);
    if (sites_ && sites_->fit(field)) return sites_;
  }
  auto made =
      std::make_shared<const RadialSites>(field, near_points_, places_in(field.frame()), frames_, carried_);
  const std::lock_guard lock(mutex_);
  return sites_ = std::move(made);
}

Points Attachment::State::positions(const DeformationField& field) const {
  const ThreadScope threads;
  Points result(distances_.size(), 3);
  const RadialField* radial = as_radial(field);
  const auto sites = radial != nullptr ? sites_of(*radial) : nullptr;
  const Points near = sites ? sites->moved(*radial) : field.at(near_points_);
  for (std::size_t i = 0; i < near_.size(); ++i) result.row(near_[i]) = near.row(static_cast<Index>(i));
  if (far_.empty()) return result;
  const Points places = places_in(field.frame());
  const Index count = places.rows();
  JetBlock<double> jets(count, JetOrder::first);
  if (sites)
    sites->evaluate_at_places(*radial, jets.view());
  else
    field.evaluate(places, jets.view());
  std::vector<double> rotations(static_cast<std::size_t>(9 * count));
  closest_rotations<double>(jets.view().column(1), count, rotations.data());
  // The places' own way there and back, so that a field that moves nothing moves nothing here.
  const Points shifts =
      (field.frame().scale / frame_.scale) * (Eigen::Map<const Points>(jets.view().data, count, 3) - places);
  Points carried = frame_.to_mesh(carried_.moved(frames_, frames_.places() + shifts, rotations.data()));
  for (std::size_t i = 0; i < far_.size(); ++i) {
    const Index row = static_cast<Index>(i);
    if (sites && sites->carried_shares().size() > 0 && sites->carried_shares()[row] < 1.0)
      carried.row(row) =
          far_points_.row(row) + sites->carried_shares()[row] * (carried.row(row) - far_points_.row(row));
    const double share = far_shares_[row];
    if (share < 1.0)
      result.row(far_[i]) += share * (carried.row(row) - result.row(far_[i]));
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
