// SPDX-License-Identifier: GPL-3.0-or-later
#include "wrap/pull.h"

#include <algorithm>
#include <cmath>

namespace arapfields {
namespace {

/// Cosines of the angle between two normals from which on, and up to which, places have nothing to do with
/// each other.
constexpr double unlike = -0.1, alike = 0.5;
/// On open targets the way there and back may miss its start by so many spacings, or so many times its
/// length.
constexpr double way_back = 1.5, way_back_share = 0.25;

double agreement(const Vec3& a, const Vec3& b) {
  return std::clamp((a.dot(b) - unlike) / (alike - unlike), 0.0, 1.0);
}

}  // namespace

void WrapForces::add(Index place, const Vec3& way, const Vec3& normal, double slack, double weight) {
  const Mat3 form = weight * ((1.0 - slack) * normal * normal.transpose() + slack * Mat3::Identity());
  forms.row(place) +=
      (Eigen::RowVectorXd(6) << form(0, 0), form(1, 1), form(2, 2), form(0, 1), form(0, 2), form(1, 2))
          .finished();
  pulls.row(place) += (form * way).transpose();
}

WrapForces::WrapForces(const WrapTarget& target, const WrapPlaces& surface, const WrapPull& pull) {
  const Points &places = surface.places, &normals = surface.normals;
  const Index n = places.rows(), m = target.points.rows();
  forms.setZero(n, 6);
  pulls.setZero(n, 3);
  agreements.setZero(n);
  const OrientedPoints tree(places, normals);
  const std::vector<Index> there = target.tree.nearest(places, normals, pull.turn);
  const std::vector<Index> back = tree.nearest(target.points, target.normals, pull.turn);
  double unmatched = 0.0;
  for (Index i = 0; i < n; ++i) {
    const Index k = there[static_cast<std::size_t>(i)];
    const Vec3 way = (target.points.row(k) - places.row(i)).transpose(), normal = target.normals.row(k);
    double weight = agreement(normal, normals.row(i)) * target.whole[k];
    if (!target.closed && weight > 0.0) {
      const Index start = back[static_cast<std::size_t>(k)];
      const double missed = (places.row(start) - places.row(i)).norm();
      if (missed > way_back * target.spacing + way_back_share * way.norm()) weight = 0.0;
    }
    if (!(weight > 0.0)) {
      unmatched += surface.shares[i];
      continue;
    }
    agreements[i] = weight;
    add(i, way, normal, pull.slack, pull.weight * weight * surface.shares[i]);
  }
  matched_share = 1.0 - unmatched;
  for (Index k = 0; k < m && pull.coverage > 0.0; ++k) {
    const Index i = back[static_cast<std::size_t>(k)];
    const Vec3 normal = target.normals.row(k);
    const double weight = agreement(normal, normals.row(i));
    if (weight > 0.0)
      add(i, (target.points.row(k) - places.row(i)).transpose(), normal, pull.slack,
          pull.weight * pull.coverage * weight / static_cast<double>(m));
  }
  if (!(pull.nearest > 0.0)) return;
  const std::vector<Index> nearest = target.tree.nearest(places, normals, 0.0);
  for (Index i = 0; i < n; ++i) {
    const Index k = nearest[static_cast<std::size_t>(i)];
    if (!target.closed && !(agreements[i] > 0.0)) continue;
    add(i, (target.points.row(k) - places.row(i)).transpose(), target.normals.row(k), pull.slack,
        pull.nearest * pull.weight * target.whole[k] * surface.shares[i]);
  }
}

}  // namespace arapfields
