// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/style.h"

#include <algorithm>
#include <cmath>

#include "core/errors.h"
#include "energies/composed_energies.h"
#include "energies/term.h"
#include "tensors/views.h"

namespace arapfields {
namespace {

/// Weight of ‖ñ − t‖² relative to 1 − g, which near a preferred normal is 5/2 ‖ñ − n_k‖² at the cube's
/// sharpness; a little more, as targets are fixed, gives a cube's style the same mean g.
constexpr double target_factor = 3.0;
/// Sharpness that stands for ObjectStyle::usual_smoothing, and the largest smoothing, in radians.
constexpr double usual_sharpness = 5.0, widest = 0.8;
/// Distance of unit vectors that count as equal: the precision of meshes in text files.
constexpr double same = 1e-4;

/// How far a surface moves grows with the logarithm of its style's weight: of the way at the whole weight, by
/// log(1 + (g − 1) share) / log g with this g, the mean of what figures do in various styles.
constexpr double weight_growth = 80.0;

class StyleTerm final : public JetTermOf<StyleTerm> {
 public:
  StyleTerm(StyleAtSamples style, double weight) : style_(std::move(style)), weight_(weight) {}
  std::string name() const override { return "style"; }
  JetOrder order() const override { return JetOrder::first; }
  void set_batch(const TermBatch& batch) override;
  template <class Scalar>
  double value(const JetView<const Scalar>& jets, const JetView<Scalar>& cotangents) const {
    return weight_ * style_energy<Scalar>(jets, normals_.in<Scalar>(), style_.preference,
                                          targets_.in<Scalar>(), weights_.in<Scalar>(), weight_, cotangents);
  }
  Tensor compose(const Tensor& jets, const EnergyTables& tables, Tensor cotangents,
                 std::vector<ComposedPart>& parts) const override;

 private:
  StyleAtSamples style_;
  double weight_;
  // Of the batch.
  PointsInBoth normals_;
  PointsInBoth targets_;      // may be empty
  VectorInBoth weights_;      // may be empty
  mutable Tensor preferred_;  // rows of the preference on the device
};

void StyleTerm::set_batch(const TermBatch& batch) {
  normals_ = PointsInBoth(batch.normals);
  if (batch.rows.empty()) {
    targets_ = PointsInBoth(style_.targets);
    weights_ = VectorInBoth(style_.weights);
    return;
  }
  const bool of_object = style_.targets.rows() > 0;
  Points targets = of_object ? batch.normals : Points(0, 3);
  Vector weights =
      Vector::Constant(style_.weights.size() > 0 ? batch.normals.rows() : 0, of_object ? 0.0 : 1.0);
  for (Index i = 0; i < batch.points.rows(); ++i) {
    const Index row = batch.rows[static_cast<std::size_t>(i)];
    if (row < 0) continue;
    if (of_object) targets.row(i) = style_.targets.row(row);
    if (weights.size() > 0) weights[i] = style_.weights[row];
  }
  targets_ = PointsInBoth(std::move(targets));
  weights_ = VectorInBoth(std::move(weights));
}

Tensor StyleTerm::compose(const Tensor& jets, const EnergyTables& tables, Tensor cotangents,
                          std::vector<ComposedPart>& parts) const {
  const auto on_device = [&](const auto& numbers) { return tensor_like(numbers, jets); };
  const Tensor normals = on_device(normals_.in<double>());
  const Vector& own = weights_.in<double>();
  const Tensor weights = own.size() > 0 ? on_device(own) : Tensor();
  Tensor energy;
  if (const auto& preference = style_.preference) {
    if (!preferred_.defined()) {
      RowMatrix<double> rows(preference->normals.rows(), 4);
      rows << preference->normals, preference->weights;
      preferred_ = on_device(rows);
    }
    energy = composed_gauss(jets, normals, weights, preferred_, preference->sharpness, weight_, tables,
                            cotangents);
  } else {
    energy = composed_targets(jets, normals, weights, on_device(targets_.in<double>()), weight_, tables,
                              cotangents);
  }
  parts.push_back({name(), weight_ * energy});
  return parts.back().value;
}

}  // namespace

double StyleAtSamples::share(double strength) const {
  if (strength >= 1.0) return strength;
  const double growth = weight_growth * (preference ? preference->balance : 1.0);
  return (std::pow(growth, strength) - 1.0) / (growth - 1.0);
}

StyleAtSamples StyleAtSamples::of(const Style& style, PointsIn normals, double sharpness) {
  StyleAtSamples result;
  if (!style.object) {
    result.preference = gauss_preference(style.preferred, sharpness);
    result.weights = result.preference->falloff(normals);
    result.factor = result.preference->balance;
    return result;
  }
  require_sharpness(sharpness);
  const double smoothing =
      ObjectStyle::usual_smoothing * (sharpness > 0.0 ? usual_sharpness / sharpness : 1.0);
  result.targets = style.object->normals(normals, std::min(smoothing, widest));
  result.weights = Vector::Ones(normals.rows());
  if (sharpness == 0.0)
    for (Index i = 0; i < normals.rows(); ++i)
      result.weights[i] = falloff_at(result.targets.row(i).dot(normals.row(i)));
  result.factor = target_factor;
  return result;
}

std::shared_ptr<JetTerm> style_term(StyleAtSamples style, double weight) {
  return std::make_shared<StyleTerm>(std::move(style), weight);
}

bool StyleAtSamples::idle(PointsIn normals) const {
  return !preference && (targets.rows() == 0 || (targets - normals).rowwise().norm().maxCoeff() < same);
}

}  // namespace arapfields
