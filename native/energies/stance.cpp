// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/stance.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/errors.h"

namespace arapfields {
namespace {

/// Share of the height within which a figure touches the ground, and what that weighs against all else.
constexpr double ground_height = 0.05, ground_weight = 8.0;

}  // namespace

Stance Stance::of(PointsIn points, const Vec3& upwards) {
  const double length = upwards.stableNorm();
  require(std::isfinite(length) && length > 0.0, "up", length == 0.0 ? "zero" : "NaN or infinite",
          "a finite direction of any positive length is allowed");
  Stance stance;
  stance.up = upwards / length;
  if (points.rows() == 0) return stance;
  const Vector heights = points * stance.up;
  const double low = heights.minCoeff(), band = ground_height * (heights.maxCoeff() - low);
  stance.ground =
      band > 0.0 ? Vector((1.0 - (heights.array() - low) / band).max(0.0)) : Vector::Ones(points.rows());
  stance.ground *= ground_weight / stance.ground.mean();
  const Eigen::RowVector3d middle = points.colwise().mean();
  const double square = (points.rowwise() - middle).rowwise().squaredNorm().mean();
  if (square > 0.0) stance.scale = 1.0 / square;
  return stance;
}

Stance Stance::at(const std::vector<Index>& rows) const {
  Stance some = *this;
  some.ground = Vector(static_cast<Index>(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i) some.ground[static_cast<Index>(i)] = ground[rows[i]];
  return some;
}

template <class Scalar>
double stance_energy(JetView<const Scalar> jets, ConstPointsRef<Scalar> rest, const Stance& stance,
                     double weight, JetView<Scalar> cotangents) {
  require(rest.rows() == jets.count && stance.ground.size() == jets.count, "rest",
          std::to_string(rest.rows()) + " points and " + std::to_string(stance.ground.size()) + " weights",
          "one of each for each of the " + std::to_string(jets.count) + " samples is needed");
  require(cotangents.data == nullptr || cotangents.count == jets.count, "cotangents", "another count",
          "as many points as the jets' are needed");
  if (jets.count == 0) return 0.0;
  Points ways = Eigen::Map<const PointsOf<Scalar>>(jets.data, jets.count, 3).template cast<double>() -
                rest.template cast<double>();
  Vector rises = ways * stance.up;
  ways.rowwise() -= ways.colwise().mean().eval();
  const double on_ground = stance.ground.sum();
  if (on_ground > 0.0) rises.array() -= stance.ground.dot(rises) / on_ground;
  const double share = stance.scale / static_cast<double>(jets.count);
  if (cotangents.data != nullptr)
    Eigen::Map<PointsOf<Scalar>>(cotangents.data, jets.count, 3) +=
        (2.0 * weight * share * (ways + stance.ground.cwiseProduct(rises) * stance.up.transpose()))
            .template cast<Scalar>();
  return share * (ways.squaredNorm() + stance.ground.dot(rises.cwiseAbs2()));
}

#define ARAPFIELDS_STANCE(Scalar)                                                                     \
  template double stance_energy<Scalar>(JetView<const Scalar>, ConstPointsRef<Scalar>, const Stance&, \
                                        double, JetView<Scalar>);
ARAPFIELDS_STANCE(float)
ARAPFIELDS_STANCE(double)

}  // namespace arapfields
