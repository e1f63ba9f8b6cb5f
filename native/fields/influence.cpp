// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/influence.h"

#include <cmath>
#include <string>

#include "core/errors.h"
#include "core/parallel.h"
#include "fields/scalar_jet.h"

namespace arapfields {
namespace {

/// Fraction of the reach within which m is 1.
constexpr double core = 0.5;

/// The fall-off as a function of the squared distance q, in squared reaches, whose jet is given: 1 near q =
/// 0, 0 from q = 1.
ScalarJet fall_off_of_square(const ScalarJet& q) {
  const double s = std::sqrt(q.c[0]), slope = 1.0 / (1.0 - core);
  const auto [value, first, second] = fall_off((s - core) * slope);
  ScalarJet result = constant(value);
  if (s <= core) return result;
  // d/dq of a function of √q.
  const double by_s = first * slope, by_ss = second * slope * slope;
  const double by_q = by_s / (2.0 * s), by_qq = by_ss / (4.0 * s * s) - by_s / (4.0 * s * s * s);
  for (int j = 0; j < 3; ++j) {
    const double qj = q.c[first_column(j)];
    result.c[first_column(j)] = by_q * qj;
    for (int k = j; k < 3; ++k)
      result.c[second_column(j, k)] = by_q * q.c[second_column(j, k)] + by_qq * qj * q.c[first_column(k)];
  }
  return result;
}

}  // namespace

Influence::Influence(Points places, Vector reaches, std::shared_ptr<const InteriorEmbedding> embedding)
    : places_(std::move(places)), reaches_(std::move(reaches)), embedding_(std::move(embedding)) {
  require(places_.rows() > 0 && reaches_.size() == places_.rows(), "influence",
          std::to_string(places_.rows()) + " places, " + std::to_string(reaches_.size()) + " reaches",
          "as many of one as of the other are needed, one or more");
  require(places_.allFinite() && reaches_.allFinite() && reaches_.minCoeff() > 0.0, "influence",
          "NaN, infinite numbers or reaches that are not positive", "finite numbers are needed");
  embedded_.resize(embedding_ ? places_.rows() : 0, 3);
  if (embedding_) embedding_->evaluate(places_, {embedded_.data(), places_.rows(), JetOrder::value});
}

template <class Consume>
void Influence::for_each_point(PointsIn points, JetOrder order, Consume&& consume) const {
  // Interior distances are not below Euclidean ones, which exclude most points.
  std::vector<std::int32_t> near(points.rows());
  parallel_for(0, points.rows(), 1024, [&](Index first, Index last) {
    for (Index p = first; p < last; ++p)
      for (Index k = 0; k < places_.rows() && near[p] == 0; ++k)
        near[p] = (points.row(p) - places_.row(k)).squaredNorm() < reaches_[k] * reaches_[k];
  });
  std::vector<Index> rows;
  for (Index p = 0; p < points.rows(); ++p) {
    if (near[p] != 0)
      rows.push_back(p);
    else
      consume(p, constant(0.0));
  }
  if (rows.empty()) return;
  const Points some = points(rows, Eigen::all);
  JetBlock<double> inside(embedding_ ? some.rows() : 0, order);
  if (embedding_) embedding_->evaluate(some, inside.view());
  parallel_for(0, some.rows(), 256, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      const Vec3 x = some.row(i);
      ScalarJet rest = constant(1.0);  // Π (1 − g)
      for (Index k = 0; k < places_.rows(); ++k) {
        if ((x.transpose() - places_.row(k)).squaredNorm() >= reaches_[k] * reaches_[k]) continue;
        const double scale = 1.0 / (reaches_[k] * reaches_[k]);
        ScalarJet square;
        for (int a = 0; a < 3; ++a) {
          const ScalarJet arm = linear(Vec3::Unit(a), -places_(k, a), x);
          square += arm * arm;
          if (!embedding_) continue;
          ScalarJet difference;
          for (int c = 0; c < columns(order); ++c) difference.c[c] = inside.view().at(c, i)[a];
          difference.c[0] -= embedded_(k, a);
          square += difference * difference;
        }
        for (double& entry : square.c) entry *= scale;
        if (square.c[0] < 1.0) rest = rest * one_minus(fall_off_of_square(square));
      }
      consume(rows[i], one_minus(rest));
    }
  });
}

Vector Influence::at(PointsIn points) const {
  Vector result(points.rows());
  for_each_point(points, JetOrder::value, [&](Index p, const ScalarJet& m) { result[p] = m.c[0]; });
  return result;
}

void Influence::confine(PointsIn points, JetView<double> jets) const {
  for_each_point(points, jets.order, [&](Index p, const ScalarJet& m) {
    const bool none = m.c[0] == 0.0;
    for (int i = 0; i < 3; ++i) {
      const ScalarJet place = linear(Vec3::Unit(i), 0.0, points.row(p).transpose());
      ScalarJet moved = place;
      if (!none) {
        ScalarJet shift;
        for (int c = 0; c < columns(jets.order); ++c) shift.c[c] = jets.at(c, p)[i] - place.c[c];
        moved += m * shift;
      }
      for (int c = 0; c < columns(jets.order); ++c) jets.at(c, p)[i] = moved.c[c];
    }
  });
}

}  // namespace arapfields
