// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/wrap_pull.h"

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

/// Of sheets that must not pass through each other: what normals count in who is opposite, and their cosine;
/// the gap that stays, as shares of the target's diagonal and of the way at rest; how far aside, in spacings,
/// the other may be.
constexpr double opposing_turn = 0.1, opposing = -0.3, contact_gap = 0.003, contact_share = 0.2,
                 contact_reach = 3.0;

double square(double x) { return x * x; }

double agreement(const Vec3& a, const Vec3& b) {
  return std::clamp((a.dot(b) - unlike) / (alike - unlike), 0.0, 1.0);
}

}  // namespace

void WrapTerms::add(Index sample, const Vec3& to, const Vec3& normal, double slack, double weight) {
  const Mat3 form = weight * ((1.0 - slack) * normal * normal.transpose() + slack * Mat3::Identity());
  forms_.row(sample) +=
      (Eigen::RowVectorXd(6) << form(0, 0), form(1, 1), form(2, 2), form(0, 1), form(0, 2), form(1, 2))
          .finished();
  const Vec3 pulled = form * to;
  linear_.row(sample) += pulled.transpose();
  constant_ += to.dot(pulled);
}

void WrapTerms::match(PointsIn places, PointsIn normals, const WrapPull& pull) {
  const Index n = places.rows(), m = target_.points.rows();
  forms_.setZero(n, 6);
  linear_.setZero(n, 3);
  constant_ = 0.0;
  const OrientedPoints surface(places, normals);
  const std::vector<Index> there = target_.tree.nearest(places, normals, pull.turn);
  const std::vector<Index> back = surface.nearest(target_.points, target_.normals, pull.turn);
  Index matched = 0;
  agreements_.setZero(n);
  for (Index i = 0; i < n; ++i) {
    const Index k = there[static_cast<std::size_t>(i)];
    const Vec3 to = target_.points.row(k), normal = target_.normals.row(k);
    double weight = agreement(normal, normals.row(i)) * target_.whole[k];
    if (!target_.closed && weight > 0.0) {
      const Index start = back[static_cast<std::size_t>(k)];
      const double missed = (places.row(start) - places.row(i)).norm();
      const double way = (to - places.row(i).transpose()).norm();
      if (missed > way_back * target_.spacing + way_back_share * way) weight = 0.0;
    }
    if (!(weight > 0.0)) continue;
    ++matched;
    agreements_[i] = weight;
    add(i, to, normal, pull.slack, pull.weight * weight / static_cast<double>(n));
  }
  matched_share_ = static_cast<double>(matched) / static_cast<double>(n);
  for (Index k = 0; k < m && pull.coverage > 0.0; ++k) {
    const Index i = back[static_cast<std::size_t>(k)];
    const Vec3 to = target_.points.row(k), normal = target_.normals.row(k);
    const double weight = agreement(normal, normals.row(i));
    if (weight > 0.0)
      add(i, to, normal, pull.slack, pull.weight * pull.coverage * weight / static_cast<double>(m));
  }
  if (pull.contact > 0.0) keep_apart(surface, places, normals, pull.contact * pull.weight);
}

/// Two sheets that face each other at rest, with a gap or the body between them, stay on their sides of the
/// plane in their middle, a little apart.
void WrapTerms::keep_apart(const OrientedPoints& surface, PointsIn places, PointsIn normals, double weight) {
  const Index n = places.rows();
  const std::vector<Index> opposite = surface.nearest(places, -normals, opposing_turn);
  const double apart = contact_gap * target_.diagonal;
  Index crossed = 0;
  for (Index i = 0; i < n; ++i) {
    const Index j = opposite[static_cast<std::size_t>(i)];
    if (normals.row(i).dot(normals.row(j)) > opposing) continue;
    const Vec3 rest = rest_.row(j) - rest_.row(i);
    const double here = rest.dot(rest_normals_.row(i)), there = -rest.dot(rest_normals_.row(j));
    if (here * there <= 0.0) continue;  // one sees the other from behind
    const Vec3 across = (normals.row(i) - normals.row(j)).normalized(), way = places.row(j) - places.row(i);
    const double side = here > 0.0 ? 1.0 : -1.0, gap = side * way.dot(across);
    const double wanted = std::min(apart, contact_share * rest.norm());
    if (gap >= wanted || way.squaredNorm() - gap * gap > square(contact_reach * target_.spacing)) continue;
    ++crossed;
    const Vec3 middle = 0.5 * (places.row(i) + places.row(j));
    add(i, middle - 0.5 * side * wanted * across, across, 0.0, weight / static_cast<double>(n));
  }
  crossed_share_ = static_cast<double>(crossed) / static_cast<double>(n);
}

double WrapTerms::evaluate(PointsIn, const JetView<const double>& jets, const JetView<double>& cotangents) {
  double value = constant_;
  for (Index i = 0; i < forms_.rows(); ++i) {
    const double* q = &forms_(i, 0);
    const Eigen::Map<const Vec3> y(jets.at(0, i));
    const Vec3 pulled(q[0] * y[0] + q[3] * y[1] + q[4] * y[2], q[3] * y[0] + q[1] * y[1] + q[5] * y[2],
                      q[4] * y[0] + q[5] * y[1] + q[2] * y[2]);
    const Vec3 rest = linear_.row(i);
    value += y.dot(pulled - 2.0 * rest);
    Eigen::Map<Vec3>(cotangents.at(0, i)) += 2.0 * (pulled - rest);
  }
  return value;
}

}  // namespace arapfields
