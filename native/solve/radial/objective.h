// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <optional>

#include "core/tall_product.h"
#include "energies/handles.h"
#include "fields/mirror.h"
#include "fields/radial_evaluator.h"
#include "optimize/quasi_newton.h"
#include "solve/radial/blend.h"
#include "solve/radial/hooks.h"
#include "solve/radial/terms.h"

namespace arapfields {

/// mean (stretch + λ·bend) + weight·handles + λ_Gauss·gauss + stance + barrier + body + external + a
/// vanishing pull of all centers towards zero, of the fields of one radial basis. Measurements: jets at the
/// samples, values at the handles' sources, centers. In single precision a step costs half, and the value is
/// good to some 1e-6 of itself.
template <class Scalar>
class RadialObjective final : public MeasuredObjectiveOf<Scalar> {
 public:
  using Measurements = Eigen::VectorX<Scalar>;

  RadialObjective(const RadialBasis& basis, PointsIn samples, double handle_weight);
  /// λ of each sample (n), and its factor on its energy (n; empty: all 1).
  void set_stiffness(const Vector& bending, const Vector& weights);
  /// A barrier against folds with this weight and threshold; 0: none.
  void set_barrier(double weight, double threshold);
  /// Other handles (cube coordinates), with the factor of the preconditioner that goes with them.
  void set_handles(const HandleBatch<double>& pairs, const RowMatrix<double>& values_of_basis,
                   const RowMatrix<double>& inverse_factor);
  /// New targets for the pairs in place.
  void set_targets(PointsIn targets);
  void set_style(const std::optional<RadialStyle>& style);
  /// Exact handles: f is no longer the radial field itself, whose values handles still pull at.
  void set_blend(RadialBlend<Scalar> blend) { blend_ = std::move(blend); }
  /// `rest` (n,3): the samples.
  void set_hooks(const RadialHooks& hooks, PointsIn rest);
  void set_stance(const std::optional<RadialStance>& stance);
  /// What a body with mass feels; none: the solve is one of shapes alone.
  void set_body(std::optional<Body<Scalar>> body) { body_ = std::move(body); }
  /// Gradients and steps are those of symmetric fields alone.
  void set_mirror(const std::optional<Mirror>& mirror) { mirror_ = mirror; }

  RadialTerms terms(const Measurements& u) const { return evaluate(u, nullptr); }
  /// What `call` makes of the jets of f at the samples.
  template <class Call>
  auto with_jets(const Measurements& u, Call&& call) const {
    if (blend_.empty()) return call(JetView<const Scalar>{u.data(), samples_.size(), JetOrder::second});
    Measurements whole = u.head(handle_offset());
    const JetView<Scalar> jets{whole.data(), samples_.size(), JetOrder::second};
    blend_.add_fixed(jets);
    return call(JetView<const Scalar>(jets));
  }
  /// Where the samples are.
  PointsOf<Scalar> sample_values(const Measurements& u) const {
    return with_jets(u, [](JetView<const Scalar> jets) {
      return PointsOf<Scalar>(Eigen::Map<const PointsOf<Scalar>>(jets.data, jets.count, 3));
    });
  }
  /// Where the field with these coefficients takes them; without a blend.
  PointsOf<Scalar> sample_values_of(const RowMatrix<double>& c) const {
    PointsOf<Scalar> values(samples_.size(), 3);
    samples_.evaluate(c, {values.data(), samples_.size(), JetOrder::value});
    return values;
  }
  /// Where the pairs' sources are.
  Eigen::Map<const PointsOf<Scalar>> handle_values(const Measurements& u) const {
    return {u.data() + handle_offset(), pairs_.sources.rows(), 3};
  }

  /// Twice the weights of the surrogate mean (‖J‖² + λ‖D‖²) + weight·handles, whose inverse precondition()
  /// has, times measurements.
  Measurements weighted(const Measurements& u) const;

  void measure(const RowMatrix<double>& c, Measurements& u) const override;
  double value(const Measurements& u, Measurements* cotangents) const override;
  RowMatrix<double> pull_back(const Measurements& cotangents) const override;
  RowMatrix<double> precondition(const RowMatrix<double>& gradient) const override;
  bool accepted(const Measurements& u) const override;

 private:
  RadialTerms evaluate(const Measurements& u, Measurements* cotangents) const;
  RadialTerms evaluate(JetView<const Scalar> jets, const Measurements& u, Scalar* cotangents) const;
  Index handle_offset() const { return 30 * samples_.size(); }
  Index center_offset() const { return handle_offset() + 3 * pairs_.sources.rows(); }

  Index center_count_;
  double handle_weight_, barrier_ = 0.0, barrier_threshold_ = 0.1;
  RadialEvaluator<Scalar> samples_;
  Eigen::VectorX<Scalar> bending_, weights_;  // weights_ may be empty
  HandleBatch<Scalar> pairs_;
  TallMatrix<Scalar> handle_basis_;   // (pairs, size)
  TallMatrix<float> inverse_factor_;  // L⁻¹ of the preconditioner's matrix L Lᵀ
  RadialBlend<Scalar> blend_;
  std::optional<RadialStyle> style_;
  std::optional<RadialStance> stance_;
  std::optional<Body<Scalar>> body_;
  PointsOf<Scalar> stance_rest_, style_normals_, style_targets_;
  Eigen::VectorX<Scalar> style_weights_;
  std::optional<Mirror> mirror_;
  RadialHooks hooks_;
  Points rest_;  // for external energies
};

/// The objective in one precision, and what it measured last.
template <class Scalar>
struct RadialPrecision {
  std::unique_ptr<RadialObjective<Scalar>> objective;
  Eigen::VectorX<Scalar> u;  // measurements of the coefficients at hand; empty: not known
  int uses = 0;              // solves since u was measured afresh
};

}  // namespace arapfields
