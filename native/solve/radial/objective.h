// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <optional>

#include "core/tall_product.h"
#include "energies/handles.h"
#include "fields/radial_evaluator.h"
#include "optimize/quasi_newton.h"
#include "solve/radial/blend.h"
#include "solve/radial/contact_stiffness.h"
#include "solve/radial/hooks.h"
#include "solve/radial/part_links.h"
#include "solve/radial/terms.h"

namespace arapfields {

/// mean (stretch + λ·bend) + weight·handles + links + λ_Gauss·gauss + stance + barrier + body + contact +
/// external + a tiny ridge on the coefficients, of the fields of one radial basis. Measurements: jets at the
/// energy samples, values at the handles' sources, links, center coefficients, values at contact points. In
/// single precision an iteration costs half, and the value has a relative error of about 1e-6.
template <class Scalar>
class RadialObjective final : public MeasuredObjectiveOf<Scalar> {
 public:
  using Measurements = Eigen::VectorX<Scalar>;

  /// For the current energy samples of the problem.
  explicit RadialObjective(const RadialProblem& problem);
  /// λ of each sample (n), and its factor on its energy (n; empty: all 1).
  void set_stiffness(const Vector& bending, const Vector& weights);
  /// Handles' pairs, the basis functions' values at their sources, and links of parts without pairs.
  void set_handles(const HandleBatch<double>& pairs, const RowMatrix<double>& basis_values,
                   const PartLinks& links);
  void set_targets(PointsIn targets);
  /// L⁻¹ of the preconditioner's matrix L Lᵀ; borrowed.
  void set_preconditioner(const TallMatrix<float>& inverse_factor) { inverse_factor_ = &inverse_factor; }
  void set_style(std::optional<StyleTerm<Scalar>> style) { style_ = std::move(style); }
  void set_stance(std::optional<StanceTerm<Scalar>> stance) { stance_ = std::move(stance); }
  /// Inertial terms of a time step; none: the solve is quasi-static.
  void set_body(std::optional<Body<Scalar>> body) { body_ = std::move(body); }
  void set_hooks(const RadialHooks& hooks) { hooks_ = hooks; }
  /// The contact planes; borrowed. Measurements with an earlier set need measure_contact() before their next
  /// use.
  void set_contact(const ContactSet& contact);
  void measure_contact(const RowMatrix<double>& c, Measurements& u) const;
  void set_contact_stiffness(ContactStiffness stiffness) { contact_stiffness_ = std::move(stiffness); }

  RadialTerms terms(const Measurements& u) const { return evaluate(u, nullptr); }
  /// Returns call(jets), with the jets of f at the energy samples.
  template <class Call>
  auto with_jets(const Measurements& u, Call&& call) const {
    if (blend_.empty()) return call(JetView<const Scalar>{u.data(), samples_.size(), JetOrder::second});
    Measurements blended = u.head(handle_offset());
    const JetView<Scalar> jets{blended.data(), samples_.size(), JetOrder::second};
    blend_.add_fixed(jets);
    return call(JetView<const Scalar>(jets));
  }
  /// f at the energy samples (n,3).
  PointsOf<Scalar> sample_values(const Measurements& u) const {
    return with_jets(u, [](JetView<const Scalar> jets) {
      return PointsOf<Scalar>(Eigen::Map<const PointsOf<Scalar>>(jets.data, jets.count, 3));
    });
  }
  /// The same for a field with these coefficients, without the blend of exact handles.
  PointsOf<Scalar> sample_values_of(const RowMatrix<double>& c) const;
  /// f at the pairs' sources.
  Eigen::Map<const PointsOf<Scalar>> handle_values(const Measurements& u) const {
    return {u.data() + handle_offset(), pairs_.sources.rows(), 3};
  }
  /// f at the contact points.
  Eigen::Map<const PointsOf<Scalar>> contact_values(const Measurements& u) const {
    return {u.data() + contact_offset(), contact_.size(), 3};
  }

  /// The Hessian, with respect to measurements, of the quadratic model mean (‖J‖² + λ‖D‖²) + weight·handles,
  /// times u; precondition() approximates the inverse of its pull-back.
  Measurements weighted(const Measurements& u) const;

  void measure(const RowMatrix<double>& c, Measurements& u) const override;
  double value(const Measurements& u, Measurements* cotangents) const override;
  RowMatrix<double> pull_back(const Measurements& cotangents) const override;
  RowMatrix<double> pull_back_contact(const PointsOf<Scalar>& cotangents) const;  ///< of contact points alone
  RowMatrix<double> precondition(const RowMatrix<double>& gradient) const override;
  double first_trial(const Measurements& u, const Measurements& du, double slope) const override;
  bool accepted(const Measurements& u) const override;

 private:
  RadialTerms evaluate(const Measurements& u, Measurements* cotangents) const;
  RadialTerms evaluate(JetView<const Scalar> jets, const Measurements& u, Scalar* cotangents) const;
  Index center_count() const { return samples_.center_count(); }
  Index handle_offset() const { return 30 * samples_.size(); }
  Index link_offset() const { return handle_offset() + 3 * pairs_.sources.rows(); }
  Index center_offset() const { return link_offset() + 3 * links_.rows(); }
  Index contact_offset() const { return center_offset() + 3 * center_count(); }
  double handle_weight() const { return problem_.options.handle_weight; }
  double barrier() const {
    return std::max(problem_.options.surface.barrier, contact_.size() > 0 ? contact_barrier : 0.0);
  }
  static constexpr double contact_barrier = 10.0;  ///< least fold barrier while handles pull into contact

  const RadialProblem& problem_;
  RadialEvaluator<Scalar> samples_;
  RadialBlend<Scalar> blend_;  // empty where handles are soft
  Eigen::VectorX<Scalar> bending_;
  Eigen::VectorX<Scalar> weights_;  // may be empty
  HandleBatch<Scalar> pairs_;
  TallMatrix<Scalar> handle_basis_;  // (pairs, size)
  TallMatrix<Scalar> links_;         // (rows, size)
  const TallMatrix<float>* inverse_factor_ = nullptr;
  std::optional<StyleTerm<Scalar>> style_;
  std::optional<StanceTerm<Scalar>> stance_;
  std::optional<Body<Scalar>> body_;
  RadialHooks hooks_;
  const ContactSet* planes_ = nullptr;
  RadialEvaluator<Scalar> contact_;
  ContactStiffness contact_stiffness_;
};

}  // namespace arapfields
