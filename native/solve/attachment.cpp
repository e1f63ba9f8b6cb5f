// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/attachment.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <typeinfo>
#include <vector>

#include "core/errors.h"
#include "core/parallel.h"
#include "distance/morton.h"
#include "energies/rotation.h"
#include "fields/radial_evaluator.h"
#include "fields/radial_field.h"
#include "sampling/nearest_sample.h"
#include "solve/carrier_frames.h"
#include "solve/setup.h"

namespace arapfields {
namespace {

/// Shares of the size up to which the field alone, and from which frames alone carry a point; and the gaps
/// between samples within which a point may lie on the surface.
constexpr double near_share = 0.05, far_share = 0.09, gaps = 4.0;
/// A surface by its size: an order of magnitude is enough.
constexpr double area_side = 1.4;

/// Points at which the fields of one basis are evaluated, neighbours beside each other.
struct RadialSites {
  RadialBasis basis;
  Frame frame;
  RadialEvaluator<double> evaluator;

  bool fits(const RadialField& field) const {
    return field.basis().embedding == basis.embedding && field.frame() == frame &&
           field.basis().center_count() == basis.center_count() && field.basis().radii == basis.radii &&
           field.basis().centers == basis.centers;
  }
};

}  // namespace

class Attachment::State {
 public:
  State(const SurfaceSamples& samples, PointsIn points, const Progress& progress);
  Points positions(const DeformationField& field) const;

  Vector distances_;

 private:
  Points near_values(const DeformationField& field) const;

  Frame frame_;
  std::vector<Index> near_, far_;  // points that the field, and that frames, have a part in
  Points near_points_;             // mesh coordinates, neighbours beside each other
  Vector far_shares_;              // (far) of the frames
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
  far_shares_ = Eigen::Map<const Vector>(shares.data(), static_cast<Index>(shares.size()));
  if (far_.empty()) return;
  frames_ = CarrierFrames(samples.points);
  progress.report(0.5, "frames of the body");
  carried_ = CarriedPoints(frames_, placed(far_, Eigen::all), distances(far_), size);
}

Points Attachment::State::near_values(const DeformationField& field) const {
  const auto* radial = dynamic_cast<const RadialField*>(&field);
  if (radial == nullptr || typeid(field) != typeid(RadialField) || radial->influence() || near_.empty())
    return field.at(near_points_);
  std::shared_ptr<const RadialSites> sites;
  {
    const std::lock_guard lock(mutex_);
    sites = sites_;
  }
  if (!sites || !sites->fits(*radial)) {
    const Frame& frame = field.frame();
    sites = std::make_shared<const RadialSites>(
        RadialSites{radial->basis(), frame, {radial->basis(), frame.to_cube(near_points_), JetOrder::value}});
    const std::lock_guard lock(mutex_);
    sites_ = sites;
  }
  Points values(near_points_.rows(), 3);
  sites->evaluator.evaluate(radial->coefficients(), {values.data(), values.rows(), JetOrder::value});
  return field.frame().to_mesh(values);
}

Points Attachment::State::positions(const DeformationField& field) const {
  const ThreadScope threads;
  Points result(distances_.size(), 3);
  const Points near = near_values(field);
  for (std::size_t i = 0; i < near_.size(); ++i) result.row(near_[i]) = near.row(static_cast<Index>(i));
  if (far_.empty()) return result;
  const Points places = field.frame().to_cube(frame_.to_mesh(frames_.places()));
  const Index count = places.rows();
  JetBlock<double> jets(count, JetOrder::first);
  field.evaluate(places, jets.view());
  std::vector<double> rotations(static_cast<std::size_t>(9 * count));
  closest_rotations<double>(jets.view().column(1), count, rotations.data());
  // The places' own way there and back, so that a field that moves nothing moves nothing here.
  const Points shifts =
      (field.frame().scale / frame_.scale) * (Eigen::Map<const Points>(jets.view().data, count, 3) - places);
  const Points carried = frame_.to_mesh(carried_.moved(frames_, frames_.places() + shifts, rotations.data()));
  for (std::size_t i = 0; i < far_.size(); ++i) {
    const Index row = static_cast<Index>(i);
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
