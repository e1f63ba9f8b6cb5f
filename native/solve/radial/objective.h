// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "core/tall_product.h"
#include "fields/radial_evaluator.h"
#include "optimize/quasi_newton.h"
#include "solve/contact/term.h"
#include "solve/jet_terms.h"
#include "solve/radial/blend.h"
#include "solve/radial/hooks.h"
#include "solve/radial/point_terms.h"
#include "solve/radial/problem.h"

namespace arapfields {

/// The sum of a list of terms over the fields of one radial basis. Measurements are one vector: the jets at
/// the energy samples, which the terms of jets share, then a segment of each term with points of its own. In
/// single precision an iteration costs half, and the value has a relative error of about 1e-6.
template <class Scalar>
class RadialObjective final : public MeasuredObjectiveOf<Scalar> {
 public:
  using Measurements = Eigen::VectorX<Scalar>;

  /// For the current energy samples of the problem.
  explicit RadialObjective(const RadialProblem& problem);
  /// The terms of jets, whose batch is the energy samples.
  void set_terms(JetTermList terms) { terms_ = std::move(terms); }
  /// λ of each sample (n), and its factor on its energy (n; empty: all 1), of the quadratic model.
  void set_stiffness(const Vector& bending, const Vector& weights);
  /// Handles' pairs, the basis functions' values at their sources, and links of parts without pairs.
  void set_handles(const HandleBatch<double>& pairs, const RowMatrix<double>& basis_values,
                   const PartLinks& links);
  void set_targets(PointsIn targets) { handles_.set_targets(targets); }
  /// L⁻¹ of the preconditioner's matrix L Lᵀ; borrowed.
  void set_preconditioner(const TallMatrix<float>& inverse_factor) { inverse_factor_ = &inverse_factor; }
  void set_observer(RadialObserver observer) { observer_ = std::move(observer); }
  /// The contact planes; borrowed. Measurements with an earlier set need measure_contact() before their next
  /// use.
  void set_contact(const ContactSet& contact);
  void measure_contact(const RowMatrix<double>& c, Measurements& u) const;
  void set_contact_stiffness(ContactStiffness stiffness) { contact_stiffness_ = std::move(stiffness); }

  /// The named, weighted terms at these measurements.
  std::vector<LossTerm> parts(const Measurements& u) const;
  /// Contact's part of the value.
  double contact_value(const Measurements& u) const;
  /// Returns call(jets), with the jets of f at the energy samples.
  template <class Call>
  auto with_jets(const Measurements& u, Call&& call) const {
    if (blend_.empty()) return call(JetView<const Scalar>{u.data(), samples_.size(), JetOrder::second});
    Measurements blended = u.head(offset_of(0));
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
  Eigen::Map<const PointsOf<Scalar>> handle_values(const Measurements& u) const { return segment(u, 0); }
  /// f at the contact points.
  Eigen::Map<const PointsOf<Scalar>> contact_values(const Measurements& u) const {
    return segment(u, contact_place);
  }

  /// The measurements of any field, to single precision.
  Measurements measured(const JetsAt& jets_at) const;
  /// The Hessian, with respect to measurements, of the quadratic model mean (‖J‖² + λ‖D‖²) + the terms' own,
  /// times u; precondition() approximates the inverse of its pull-back.
  Measurements weighted(const Measurements& u) const;

  void measure(const RowMatrix<double>& c, Measurements& u) const override;
  double value(const Measurements& u, Measurements* cotangents) const override {
    return evaluate(u, cotangents, nullptr);
  }
  RowMatrix<double> pull_back(const Measurements& cotangents) const override;
  RowMatrix<double> pull_back_contact(const PointsOf<Scalar>& cotangents) const;  ///< of contact points alone
  RowMatrix<double> precondition(const RowMatrix<double>& gradient) const override;
  double first_trial(const Measurements& u, const Measurements& du, double slope) const override;
  bool accepted(const Measurements& u) const override { return !observer_ || observer_(parts(u)); }

 private:
  /// The terms with points of their own, in the order of their segments. Contact is last: its points change
  /// from search to search.
  std::array<const PointTerm<Scalar>*, 4> point_terms() const {
    return {&handles_, &links_, &ridge_, &contact_};
  }
  static constexpr std::size_t contact_place = 3;
  /// Where a term's segment begins; after the last one, where all end.
  Index offset_of(std::size_t place) const;
  Eigen::Map<const PointsOf<Scalar>> segment(const Measurements& u, std::size_t place) const {
    return {u.data() + offset_of(place), point_terms()[place]->rows(), 3};
  }
  double evaluate(const Measurements& u, Measurements* cotangents, std::vector<LossTerm>* parts) const;
  Index center_count() const { return samples_.center_count(); }

  const RadialProblem& problem_;
  RadialEvaluator<Scalar> samples_;
  RadialBlend<Scalar> blend_;  // empty where handles are soft
  JetTermList terms_{JetTermSettings()};
  HandleTerm<Scalar> handles_;
  LinkTerm<Scalar> links_;
  RidgeTerm<Scalar> ridge_;
  ContactTerm<Scalar> contact_;
  Eigen::VectorX<Scalar> bending_;
  Eigen::VectorX<Scalar> weights_;  // may be empty
  const TallMatrix<float>* inverse_factor_ = nullptr;
  ContactStiffness contact_stiffness_;
  RadialObserver observer_;
};

}  // namespace arapfields
