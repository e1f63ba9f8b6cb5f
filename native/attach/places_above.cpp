// SPDX-License-Identifier: GPL-3.0-or-later
#include "attach/places_above.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "attach/surface_frames.h"
#include "core/jacobians.h"
#include "core/parallel.h"
#include "sampling/nearest_sample.h"
#include "sampling/oriented_points.h"

namespace arapfields {
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

}  // namespace arapfields
