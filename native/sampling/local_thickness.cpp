// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/local_thickness.h"

#include <algorithm>
#include <cmath>

#include "core/frame.h"
#include "core/parallel.h"
#include "sampling/fine_regions.h"
#include "sampling/inner_balls.h"
#include "sampling/sample_choice.h"

namespace arapfields {
namespace {

constexpr Index most_witnesses = 6000;
/// Points of a fine region, which has few, for each place where it is measured.
constexpr Index points_a_place = 2;
/// The limits, as fractions of the radius of gyration.
constexpr double most_share = 0.6, least_share = 0.02;
/// The most of an open sheet, as a fraction of the square root of its area.
constexpr double sheet_share = 0.03;
/// Distance, as a fraction of a ball's radius, by which a point may be outside of it.
constexpr double overlap_share = 0.25;
/// InnerBallRules: least_cosine, and `near` in spacings of the witnesses.
constexpr double least_cosine = 0.2, facing_spacings = 3.0;
/// Values are averaged within so many thicknesses, and blended between nodes within so many spacings.
constexpr double smooth_share = 0.5, blend_spacings = 1.0;

}  // namespace

LocalThickness::LocalThickness(PointsIn samples, PointsIn normals, const std::vector<std::uint32_t>& order,
                               const Vector& sheet_sizes, Index most) {
  const bool extended = (samples.rowwise() - samples.row(0)).cwiseAbs().maxCoeff() > 0.0;
  const double gyration =
      extended ? Frame::balanced(samples, Vector::Ones(samples.rows()), {}, 1.0).scale : 1.0;
  most_ = median_ = most_share * gyration;
  if (!extended || normals.rows() != samples.rows()) return;
  const std::vector<Index> chosen = evenly(order, most), witness_rows = evenly(order, most_witnesses);
  nodes_ = samples(chosen, Eigen::all);
  const Points node_normals = normals(chosen, Eigen::all);
  const Points witnesses = samples(witness_rows, Eigen::all),
               witness_normals = normals(witness_rows, Eigen::all);
  // The square root of a sphere's area of this radius of gyration: spacings need only its order of magnitude.
  const double side = 3.5 * gyration;
  spacing_ = side / std::sqrt(static_cast<double>(nodes_.rows()));
  const double witness_spacing = side / std::sqrt(static_cast<double>(witnesses.rows()));
  Vector radii =
      inner_radii(nodes_, node_normals, witnesses, witness_normals,
                  {.most = most_, .least_cosine = least_cosine, .near = facing_spacings * witness_spacing});
  const Index n = nodes_.rows();
  sheets_.assign(static_cast<std::size_t>(n), false);
  for (Index i = 0; i < n && sheet_sizes.size() > 0; ++i)
    if (const double size = sheet_sizes[chosen[static_cast<std::size_t>(i)]]; size > 0.0) {
      sheets_[i] = true;
      radii[i] = std::min(radii[i], sheet_share * size);
    }
  const Points centers = nodes_ - radii.asDiagonal() * node_normals;
  Vector thickness(n);
  const double least = least_share * gyration;
  parallel_for(0, n, 32, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      double largest = std::max(least, radii[i]);
      for (Index j = 0; j < n; ++j) {
        const double limit = (1.0 + overlap_share) * radii[j];
        if (radii[j] > largest && sheets_[i] == sheets_[j] &&
            (centers.row(j) - nodes_.row(i)).squaredNorm() <= limit * limit)
          largest = radii[j];
      }
      thickness[i] = largest;
    }
  });
  values_.resize(n);
  parallel_for(0, n, 32, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      const double width = std::max(smooth_share * thickness[i], spacing_);
      double sum = 0.0, total = 0.0;
      for (Index j = 0; j < n; ++j) {
        const double square = (nodes_.row(j) - nodes_.row(i)).squaredNorm();
        if (square >= width * width || sheets_[i] != sheets_[j]) continue;
        const double weight = 1.0 - square / (width * width);
        if (weight > 0.0) sum += weight * thickness[j], total += weight;
      }
      values_[i] = sum / total;
    }
  });
  std::vector<double> sorted(values_.begin(), values_.end());
  std::nth_element(sorted.begin(), sorted.begin() + n / 2, sorted.end());
  median_ = sorted[n / 2];
}

/// The thickness of a fine region by its own points.
struct LocalThickness::Fine {
  FineRegion region;
  LocalThickness thickness;
};

void LocalThickness::refine(const FineRegion& region) {
  fine_.push_back(std::make_shared<const Fine>(
      Fine{region, LocalThickness(region.points, region.normals, canonical_order(region.points), {},
                                  region.points.rows() / points_a_place)}));
}

Points LocalThickness::thinner_than(double thickness) const {
  std::vector<Index> rows;
  for (Index i = 0; i < values_.size(); ++i)
    if (values_[i] < thickness) rows.push_back(i);
  return nodes_(rows, Eigen::all);
}

Vector LocalThickness::at(PointsIn points) const {
  Vector result = blended(points);
  for (const auto& fine : fine_) {
    const Vector shares = fine->region.shares_at(points);
    std::vector<Index> rows;
    for (Index i = 0; i < shares.size(); ++i)
      if (shares[i] > 0.0) rows.push_back(i);
    if (rows.empty()) continue;
    const Vector own = fine->thickness.blended(points(rows, Eigen::all));
    for (std::size_t k = 0; k < rows.size(); ++k)
      result[rows[k]] += shares[rows[k]] * (own[static_cast<Index>(k)] - result[rows[k]]);
  }
  return result;
}

Vector LocalThickness::blended(PointsIn points) const {
  Vector result = Vector::Constant(points.rows(), most_);
  const Index n = nodes_.rows();
  if (n == 0) return result;
  const double width = blend_spacings * spacing_;
  const Eigen::ArrayX3d nodes = nodes_;  // by columns
  parallel_for(0, points.rows(), 64, [&](Index first, Index last) {
    Vector squares(n);
    for (Index i = first; i < last; ++i) {
      // head(n) cannot be resized: for `squares` itself, GCC 12 for ARM warns of a use of freed memory.
      squares.head(n).array() = (nodes.col(0) - points(i, 0)).square() +
                                (nodes.col(1) - points(i, 1)).square() +
                                (nodes.col(2) - points(i, 2)).square();
      Index own = 0;  // the point's kind is that of the node nearest to it
      const double nearest = squares.minCoeff(&own), farthest = nearest + width * width;
      double sum = 0.0, total = 0.0;
      for (Index j = 0; j < n; ++j)
        if (squares[j] < farthest && sheets_[j] == sheets_[own]) {
          const double weight = 1.0 - (squares[j] - nearest) / (width * width);
          sum += weight * values_[j], total += weight;
        }
      result[i] = sum / total;
    }
  });
  return result;
}

}  // namespace arapfields
