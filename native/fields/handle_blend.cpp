// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/handle_blend.h"

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdio>

#include "core/errors.h"
#include "core/parallel.h"
#include "fields/scalar_jet.h"

namespace arapfields {
namespace {

std::string label(const RigidRegion& region, std::size_t index) {
  return region.name.empty() ? "region " + std::to_string(index) : region.name;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

}  // namespace

HandleBlend::HandleBlend(std::vector<RigidRegion> regions) : regions_(std::move(regions)) {
  for (std::size_t i = 0; i < regions_.size(); ++i) {
    const RigidRegion& region = regions_[i];
    const std::string name = label(region, i);
    require(std::isfinite(region.margin) && region.margin > 0.0, name, "a margin of " + number(region.margin),
            "it must be positive");
    const Mat3 edges = region.placement.topLeftCorner<3, 3>();
    OrientedBox box{Mat3::Identity(), region.placement.topRightCorner<3, 1>(), edges.colwise().norm()};
    if (box.half_extents.maxCoeff() > 0.0) {
      require(box.half_extents.minCoeff() > 1e-9, name, "a box without volume",
              "exact handles need three edges of positive length");
      box.directions = (edges * box.half_extents.cwiseInverse().asDiagonal()).transpose();
      const double shear = (box.directions * box.directions.transpose() - Mat3::Identity()).norm();
      require(shear < 1e-4, name, "a sheared box", "exact handles need edges at right angles");
    }
    boxes_.push_back(box);
  }
}

double HandleBlend::distance(Index region, const Vec3& point) const {
  const OrientedBox& box = boxes_[region];
  return ((box.directions * (point - box.center)).cwiseAbs() - box.half_extents).maxCoeff();
}

template <class Consume>
void HandleBlend::for_each_point(PointsIn points, Consume&& consume) const {
  parallel_for(0, points.rows(), 256, [&](Index begin, Index end) {
    for (Index p = begin; p < end; ++p) {
      const Vec3 x = points.row(p);
      ScalarJet free = constant(1.0);
      std::array<ScalarJet, 3> moved;
      for (int i = 0; i < 3; ++i) moved[i] = linear(Vec3::Unit(i), 0.0, x);
      for (std::size_t r = 0; r < regions_.size(); ++r) {
        const OrientedBox& box = boxes_[r];
        if (distance(static_cast<Index>(r), x) >= regions_[r].margin) continue;
        ScalarJet weight = constant(1.0);
        for (int a = 0; a < 3; ++a) {
          const Vec3 direction = box.directions.row(a);
          const double u = direction.dot(x - box.center), inverse = 1.0 / regions_[r].margin;
          const auto [s, ds, dds] = fall_off((std::abs(u) - box.half_extents[a]) * inverse);
          const Vec3 slope = (u < 0.0 ? -inverse : inverse) * direction;
          ScalarJet factor = constant(s);
          for (int j = 0; j < 3; ++j) {
            factor.c[first_column(j)] = ds * slope[j];
            for (int k = j; k < 3; ++k) factor.c[second_column(j, k)] = dds * slope[j] * slope[k];
          }
          weight = weight * factor;
        }
        const ScalarJet share = weight * free;
        for (int i = 0; i < 3; ++i) {
          const Vec3 row = regions_[r].motion.block<1, 3>(i, 0).transpose() - Vec3::Unit(i);
          moved[i] += share * linear(row, regions_[r].motion(i, 3), x);
        }
        free = free * one_minus(weight);
      }
      consume(p, moved, free);
    }
  });
}

void HandleBlend::evaluate(PointsIn points, JetView<double> out) const {
  for_each_point(points, [&](Index p, const auto& moved, const auto&) {
    for (int c = 0; c < columns(out.order); ++c)
      for (int i = 0; i < 3; ++i) out.at(c, p)[i] = moved[i].c[c];
  });
}

void HandleBlend::free_weight(PointsIn points, JetOrder order, double* out) const {
  for_each_point(points, [&](Index p, const auto&, const auto& free) {
    for (int c = 0; c < columns(order); ++c) out[c * points.rows() + p] = free.c[c];
  });
}

std::vector<std::string> limit_margins(std::vector<RigidRegion>& regions,
                                       const std::vector<Points>& members) {
  constexpr double agreement = 1e-6, least_margin = 1e-3;
  std::vector<std::string> notes;
  const HandleBlend blend(regions);
  for (std::size_t i = 0; i < regions.size(); ++i)
    for (std::size_t j = i + 1; j < regions.size(); ++j) {
      double gap = regions[i].margin;
      for (Index p = 0; p < members[j].rows(); ++p) {
        const Vec3 x = members[j].row(p);
        const Mat4 difference = regions[i].motion - regions[j].motion;
        if ((difference * x.homogeneous()).norm() > agreement)
          gap = std::min(gap, blend.distance(static_cast<Index>(i), x));
      }
      const std::string pair = label(regions[i], i) + " and " + label(regions[j], j);
      require(gap > 0.0, pair, "they overlap and move the surface in different ways",
              "exact handles must be apart");
      require(gap >= least_margin, pair, "they are only " + number(gap) + " apart (unit cube)",
              "exact handles that move differently need a gap of " + number(least_margin));
      if (gap < regions[i].margin)
        notes.push_back(pair + " nearly overlap: the first one's margin was reduced from " +
                        number(regions[i].margin) + " to " + number(gap) + " (unit cube)");
      regions[i].margin = gap;
    }
  return notes;
}

}  // namespace arapfields
