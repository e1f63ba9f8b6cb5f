// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/stance.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/decompositions.h"
#include "core/errors.h"
#include "energies/composed_energies.h"
#include "energies/term.h"
#include "tensors/views.h"

namespace arapfields {
namespace {

/// Height, as a fraction of the figure's, below which samples are on the ground, and their weight.
constexpr double ground_height = 0.05, ground_weight = 128.0;
/// Samples at least, where there are as many, whose mean says where a figure is.
constexpr Index anchoring_samples = 500;

/// lean_weight · Σ‖a‖² · ‖ω − (ω·up) up‖² of samples with arms a (n,3) about their mean, ω being the
/// infinitesimal rotation closest to their displacements (n,3); and half its cotangents are arms · slope.
struct Lean {
  double energy = 0.0;
  Mat3 slope = Mat3::Zero();
};

Lean lean_of(const Points& arms, const Points& displacements, const Vec3& up) {
  const Mat3 spread = cross_moments(arms, arms), moment = cross_moments(arms, displacements);
  const double size = spread.trace();
  if (!(size > 0.0)) return {};
  const Mat3 inertia = (1.0 + Stance::thinnest) * size * Mat3::Identity() - spread;
  const Vec3 torque(moment(1, 2) - moment(2, 1), moment(2, 0) - moment(0, 2), moment(0, 1) - moment(1, 0));
  Vec3 turn = solve_definite(inertia, torque);
  turn -= turn.dot(up) * up;
  const Vec3 restoring = Stance::lean_weight * size * solve_definite(inertia, turn);
  Mat3 slope;  // of row vectors: a · slope = restoring × a
  slope << 0.0, restoring.z(), -restoring.y(), -restoring.z(), 0.0, restoring.x(), restoring.y(),
      -restoring.x(), 0.0;
  return {Stance::lean_weight * size * turn.squaredNorm(), slope};
}

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

Points anchor_places(const Vec3& lowest, PointsIn samples) {
  const Index stride = std::max<Index>(1, samples.rows() / anchoring_samples);
  Points places(1 + (samples.rows() + stride - 1) / stride, 3);
  places.row(0) = lowest.transpose();
  for (Index i = 1; i < places.rows(); ++i) places.row(i) = samples.row((i - 1) * stride);
  return places;
}

Vec3 anchoring_shift(PointsIn places, PointsIn values, const Vec3& up) {
  const Vec3 direction = up.normalized();
  const Points motion = places - values;
  const Vec3 mean = motion.bottomRows(motion.rows() - 1).colwise().mean().transpose();
  return mean + (motion.row(0).dot(direction) - mean.dot(direction)) * direction;
}

Stance Stance::at(const std::vector<Index>& rows) const {
  Stance some = *this;
  some.ground = Vector(static_cast<Index>(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i) some.ground[i] = ground[rows[i]];
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
  Points displacements =
      Eigen::Map<const PointsOf<Scalar>>(jets.data, jets.count, 3).template cast<double>() -
      rest.template cast<double>();
  Vector rises = displacements * stance.up;
  displacements.rowwise() -= displacements.colwise().mean().eval();
  const double on_ground = stance.ground.sum();
  if (on_ground > 0.0) rises.array() -= stance.ground.dot(rises) / on_ground;
  const double share = stance.scale / static_cast<double>(jets.count);
  Points arms = rest.template cast<double>();
  arms.rowwise() -= arms.colwise().mean().eval();
  const Lean lean = lean_of(arms, displacements, stance.up);
  if (cotangents.data != nullptr)
    Eigen::Map<PointsOf<Scalar>>(cotangents.data, jets.count, 3) +=
        (2.0 * weight * share *
         (displacements + stance.ground.cwiseProduct(rises) * stance.up.transpose() + arms * lean.slope))
            .template cast<Scalar>();
  return share * (displacements.squaredNorm() + stance.ground.dot(rises.cwiseAbs2()) + lean.energy);
}

namespace {

class StanceTerm final : public JetTermOf<StanceTerm> {
 public:
  StanceTerm(Stance stance, double weight) : stance_(std::move(stance)), weight_(weight) {}
  std::string name() const override { return "stance"; }
  JetOrder order() const override { return JetOrder::value; }
  void set_batch(const TermBatch& batch) override {
    rest_ = PointsInBoth(batch.points);
    batch_ = stance_;
    if (batch.rows.empty()) return;
    batch_.ground.setZero(batch.points.rows());
    for (Index i = 0; i < batch.points.rows(); ++i)
      if (const Index row = batch.rows[static_cast<std::size_t>(i)]; row >= 0)
        batch_.ground[i] = stance_.ground[row];
  }
  template <class Scalar>
  double value(const JetView<const Scalar>& jets, const JetView<Scalar>& cotangents) const {
    return weight_ * stance_energy<Scalar>(jets, rest_.in<Scalar>(), batch_, weight_, cotangents);
  }
  Tensor compose(const Tensor& jets, const EnergyTables& tables, Tensor cotangents,
                 std::vector<ComposedPart>& parts) const override {
    const double weight = weight_ * batch_.scale;
    parts.push_back(
        {name(), weight * composed_stance(jets, tensor_like(rest_.in<double>(), jets),
                                          tensor_like(Vector(batch_.up), jets),
                                          tensor_like(batch_.ground, jets), weight, tables, cotangents)});
    return parts.back().value;
  }

 private:
  Stance stance_;  // of all samples
  Stance batch_;
  PointsInBoth rest_;
  double weight_;
};

}  // namespace

std::shared_ptr<JetTerm> stance_term(Stance stance, double weight) {
  return std::make_shared<StanceTerm>(std::move(stance), weight);
}

#define ARAPFIELDS_STANCE(Scalar)                                                                     \
  template double stance_energy<Scalar>(JetView<const Scalar>, ConstPointsRef<Scalar>, const Stance&, \
                                        double, JetView<Scalar>);
ARAPFIELDS_STANCE(float)
ARAPFIELDS_STANCE(double)

}  // namespace arapfields
