// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/objective.h"

namespace arapfields {

template <class Scalar>
RadialObjective<Scalar>::RadialObjective(const RadialProblem& problem)
    : problem_(problem), samples_(problem.basis, problem.energy_points), ridge_(samples_.center_count()) {
  if (problem.blend) blend_ = RadialBlend<Scalar>(*problem.blend, problem.energy_points);
}

template <class Scalar>
void RadialObjective<Scalar>::set_stiffness(const Vector& bending, const Vector& weights) {
  bending_ = bending.cast<Scalar>();
  weights_ = weights.cast<Scalar>();
}

template <class Scalar>
void RadialObjective<Scalar>::set_handles(const HandleBatch<double>& pairs,
                                          const RowMatrix<double>& basis_values, const PartLinks& links) {
  handles_ = HandleTerm<Scalar>(pairs, basis_values, problem_.options.handle_weight);
  links_ = LinkTerm<Scalar>(links);
}

template <class Scalar>
void RadialObjective<Scalar>::set_contact(const ContactSet& contact) {
  contact_ = ContactTerm<Scalar>(problem_.basis, contact);
  contact_stiffness_ = {};
}

template <class Scalar>
Index RadialObjective<Scalar>::offset_of(std::size_t place) const {
  Index offset = 30 * samples_.size();
  const auto terms = point_terms();
  for (std::size_t i = 0; i < place; ++i) offset += 3 * terms[i]->rows();
  return offset;
}

template <class Scalar>
PointsOf<Scalar> RadialObjective<Scalar>::sample_values_of(const RowMatrix<double>& c) const {
  PointsOf<Scalar> values(samples_.size(), 3);
  samples_.evaluate(c, {values.data(), samples_.size(), JetOrder::value});
  return values;
}

template <class Scalar>
double RadialObjective<Scalar>::first_trial(const Measurements& u, const Measurements& du,
                                            double slope) const {
  if (contact_.rows() == 0) return 1.0;
  const Index offset = offset_of(contact_place);
  return contact_.first_trial(u.data() + offset, du.data() + offset, slope);
}

template <class Scalar>
std::vector<LossTerm> RadialObjective<Scalar>::parts(const Measurements& u) const {
  std::vector<LossTerm> result;
  evaluate(u, nullptr, &result);
  return result;
}

template <class Scalar>
double RadialObjective<Scalar>::contact_value(const Measurements& u) const {
  return contact_.rows() > 0 ? contact_.value(u.data() + offset_of(contact_place), nullptr) : 0.0;
}

template <class Scalar>
void RadialObjective<Scalar>::measure(const RowMatrix<double>& c, Measurements& u) const {
  const auto terms = point_terms();
  u.resize(offset_of(terms.size()));
  samples_.evaluate(c, {u.data(), samples_.size(), JetOrder::second});
  blend_.multiply({u.data(), samples_.size(), JetOrder::second});
  const PointsOf<Scalar> rounded = c.cast<Scalar>();
  for (std::size_t i = 0; i < terms.size(); ++i)
    if (terms[i]->rows() > 0) terms[i]->measure(c, rounded, u.data() + offset_of(i));
}

template <class Scalar>
void RadialObjective<Scalar>::measure_contact(const RowMatrix<double>& c, Measurements& u) const {
  const Index offset = offset_of(contact_place);
  u.conservativeResize(offset + 3 * contact_.rows());
  if (contact_.rows() > 0) contact_.measure(c, {}, u.data() + offset);
}

template <class Scalar>
Eigen::VectorX<Scalar> RadialObjective<Scalar>::measured(const JetsAt& jets_at) const {
  const Points& places = problem_.energy_points;
  RowMatrix<double> jets = jets_at(places, JetOrder::second);
  if (problem_.blend)
    RadialBlend<double>(*problem_.blend, places).multiply({jets.data(), places.rows(), JetOrder::second});
  const auto terms = point_terms();
  Measurements u(offset_of(terms.size()));
  u.head(jets.size()) = jets.reshaped<Eigen::RowMajor>().template cast<float>().template cast<Scalar>();
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (terms[i]->rows() == 0) continue;
    const RowMatrix<double> own = terms[i]->measure_field(jets_at);
    u.segment(offset_of(i), own.size()) =
        own.reshaped<Eigen::RowMajor>().template cast<float>().template cast<Scalar>();
  }
  return u;
}

/// The loop over all terms: their sum, cotangents and parts.
template <class Scalar>
double RadialObjective<Scalar>::evaluate(const Measurements& u, Measurements* cotangents,
                                         std::vector<LossTerm>* parts) const {
  if (cotangents != nullptr) cotangents->setZero(u.size());
  const auto at = [&](Index offset) { return cotangents != nullptr ? cotangents->data() + offset : nullptr; };
  double value = 0.0;
  const auto add_points = [&](std::size_t place, const char* name) {
    const PointTerm<Scalar>& term = *point_terms()[place];
    if (term.rows() == 0) return;
    const Index offset = offset_of(place);
    const double own = term.value(u.data() + offset, at(offset));
    if (parts != nullptr && name != nullptr) parts->push_back({name, own});
    value += own;
  };
  with_jets(u, [&](JetView<const Scalar> jets) {
    const JetView<Scalar> jet_cotangents{at(0), samples_.size(), JetOrder::second};
    const auto add = [&](const JetTerm& term) { value += term.evaluate(jets, jet_cotangents, parts); };
    add(*terms_.own.front());
    add_points(0, "handles");
    std::for_each(terms_.own.begin() + 1, terms_.own.end(), [&](const auto& term) { add(*term); });
    add_points(contact_place, "contact");
    for (const auto& term : terms_.callers) add(*term);
  });
  add_points(1, nullptr);
  add_points(2, nullptr);
  return value;
}

template <class Scalar>
Eigen::VectorX<Scalar> RadialObjective<Scalar>::weighted(const Measurements& u) const {
  Measurements result = Measurements::Zero(u.size());
  const Index n = samples_.size();
  for (int c = 1; c < 10; ++c) {
    const Eigen::Map<const PointsOf<Scalar>> from(u.data() + 3 * c * n, n, 3);
    Eigen::Map<PointsOf<Scalar>> to(result.data() + 3 * c * n, n, 3);
    const Scalar share = Scalar(c < 7 ? 2.0 : 4.0) / static_cast<Scalar>(n);
    if (c < 4)
      to = share * from;
    else
      to = share * (bending_.asDiagonal() * from);
    if (weights_.size() > 0) to = weights_.asDiagonal() * to;
  }
  const auto terms = point_terms();
  for (std::size_t i = 0; i < terms.size(); ++i)
    if (terms[i]->rows() > 0) terms[i]->model(u.data() + offset_of(i), result.data() + offset_of(i));
  return result;
}

template <class Scalar>
RowMatrix<double> RadialObjective<Scalar>::pull_back(const Measurements& cotangents) const {
  RowMatrix<double> gradient = RowMatrix<double>::Zero(center_count() + 4, 3);
  if (blend_.empty()) {
    samples_.pull_back({cotangents.data(), samples_.size(), JetOrder::second}, gradient);
  } else {
    Measurements own = cotangents.head(offset_of(0));
    blend_.multiply_transposed({own.data(), samples_.size(), JetOrder::second});
    samples_.pull_back({own.data(), samples_.size(), JetOrder::second}, gradient);
  }
  const auto terms = point_terms();
  for (std::size_t i = 0; i < terms.size(); ++i)
    if (terms[i]->rows() > 0) terms[i]->pull_back(cotangents.data() + offset_of(i), gradient);
  if (problem_.mirror) problem_.mirror->symmetrise(gradient);
  return gradient;
}

template <class Scalar>
RowMatrix<double> RadialObjective<Scalar>::pull_back_contact(const PointsOf<Scalar>& cotangents) const {
  RowMatrix<double> gradient = RowMatrix<double>::Zero(center_count() + 4, 3);
  contact_.pull_back(cotangents.data(), gradient);
  if (problem_.mirror) problem_.mirror->symmetrise(gradient);
  return gradient;
}

template <class Scalar>
RowMatrix<double> RadialObjective<Scalar>::precondition(const RowMatrix<double>& gradient) const {
  const double size = gradient.norm();
  if (!(size > 0.0)) return gradient;
  const PointsF scaled = (gradient / size).cast<float>();
  PointsF half = inverse_factor_->times(scaled);
  contact_stiffness_.apply(half);
  RowMatrix<double> step = (0.5 * size) * inverse_factor_->transpose_times(half).cast<double>();
  if (problem_.mirror) problem_.mirror->symmetrise(step);
  return step;
}

template class RadialObjective<float>;
template class RadialObjective<double>;

}  // namespace arapfields
