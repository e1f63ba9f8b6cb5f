// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/objective.h"

#include <numeric>

#include "core/errors.h"
#include "energies/distortion.h"

namespace arapfields {
namespace {

/// Weight of the ridge on the centers' coefficients: removes components that vanish at all samples.
constexpr double coefficient_weight = 1e-10;

}  // namespace

template <class Scalar>
RadialObjective<Scalar>::RadialObjective(const RadialProblem& problem)
    : problem_(problem), samples_(problem.basis, problem.energy_points) {
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
  pairs_ = {pairs.sources.cast<Scalar>(), pairs.targets.cast<Scalar>(), pairs.weights.cast<Scalar>()};
  handle_basis_ = TallMatrix<Scalar>(basis_values);
  links_ = TallMatrix<Scalar>(links.rows());
}

template <class Scalar>
void RadialObjective<Scalar>::set_targets(PointsIn targets) {
  require(targets.rows() == pairs_.sources.rows(), "targets", std::to_string(targets.rows()) + " rows",
          std::to_string(pairs_.sources.rows()) + " are needed");
  pairs_.targets = targets.cast<Scalar>();
}

template <class Scalar>
void RadialObjective<Scalar>::set_contact(const ContactSet& contact) {
  planes_ = &contact;
  contact_stiffness_ = {};
  contact_ = contact.planes.empty()
                 ? RadialEvaluator<Scalar>()
                 : RadialEvaluator<Scalar>(problem_.basis, contact.places, JetOrder::value,
                                           contact.embedded.rows() > 0 ? &contact.embedded : nullptr);
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
  if (contact_.size() == 0) return 1.0;
  return contact_step<Scalar>(planes_->planes, planes_->stiffness, u.data() + contact_offset(),
                              du.data() + contact_offset(), slope);
}

template <class Scalar>
bool RadialObjective<Scalar>::accepted(const Measurements& u) const {
  if (!hooks_.observer) return true;
  const RadialTerms terms = evaluate(u, nullptr);
  std::vector<LossTerm> parts{{"stretch", terms.arap.stretch_energy}};
  if ((bending_.array() > 0).any()) parts.push_back({"bend", terms.arap.energy - terms.arap.stretch_energy});
  if (style_) parts.push_back({"style", style_->weight * terms.gauss});
  if (stance_) parts.push_back({"stance", stance_->weight * terms.stance});
  if (barrier() > 0.0) parts.push_back({"barrier", barrier() * terms.barrier});
  if (body_) parts.push_back({"motion", terms.body.sum()});
  if (contact_.size() > 0) parts.push_back({"contact", terms.contact});
  parts.push_back({"handles", handle_weight() * terms.handles});
  for (std::size_t i = 0; i < terms.external.size(); ++i)
    parts.push_back({"energies[" + std::to_string(i) + "]", terms.external[i]});
  return hooks_.observer(parts);
}

template <class Scalar>
void RadialObjective<Scalar>::measure(const RowMatrix<double>& c, Measurements& u) const {
  u.resize(contact_offset() + 3 * contact_.size());
  samples_.evaluate(c, {u.data(), samples_.size(), JetOrder::second});
  blend_.multiply({u.data(), samples_.size(), JetOrder::second});
  const PointsOf<Scalar> rounded = c.cast<Scalar>();
  Eigen::Map<PointsOf<Scalar>>(u.data() + handle_offset(), pairs_.sources.rows(), 3) =
      handle_basis_.times(rounded);
  if (links_.rows() > 0)
    Eigen::Map<PointsOf<Scalar>>(u.data() + link_offset(), links_.rows(), 3) = links_.times(rounded);
  u.segment(center_offset(), 3 * center_count()) =
      Eigen::Map<const Measurements>(rounded.data(), 3 * center_count());
  measure_contact(c, u);
}

template <class Scalar>
void RadialObjective<Scalar>::measure_contact(const RowMatrix<double>& c, Measurements& u) const {
  u.conservativeResize(contact_offset() + 3 * contact_.size());
  if (contact_.size() > 0)
    contact_.evaluate(c, {u.data() + contact_offset(), contact_.size(), JetOrder::value});
}

template <class Scalar>
RadialTerms RadialObjective<Scalar>::evaluate(const Measurements& u, Measurements* cotangents) const {
  if (cotangents != nullptr) cotangents->setZero(u.size());
  return with_jets(u, [&](JetView<const Scalar> jets) {
    return evaluate(jets, u, cotangents != nullptr ? cotangents->data() : nullptr);
  });
}

template <class Scalar>
RadialTerms RadialObjective<Scalar>::evaluate(JetView<const Scalar> jets, const Measurements& u,
                                              Scalar* out) const {
  const JetView<Scalar> jet_cotangents{out, samples_.size(), JetOrder::second};
  RadialTerms terms;
  terms.arap = arap_energy<Scalar>(jets, 1.0, 1.0, jet_cotangents,
                                   {weights_.size() > 0 ? weights_.data() : nullptr, bending_.data()});
  const Index pairs = pairs_.sources.rows();
  terms.handles =
      handle_energy<Scalar>({u.data() + handle_offset(), pairs, JetOrder::value}, pairs_, handle_weight(),
                            {out != nullptr ? out + handle_offset() : nullptr, pairs, JetOrder::value});
  if (style_)
    terms.gauss = style_energy<Scalar>(jets, style_->normals, style_->preference, style_->targets,
                                       style_->weights, style_->weight, jet_cotangents);
  if (stance_)
    terms.stance =
        stance_energy<Scalar>(jets, stance_->rest, stance_->stance, stance_->weight, jet_cotangents);
  if (barrier() > 0.0)
    terms.barrier =
        fold_barrier<Scalar>(jets, problem_.options.surface.barrier_threshold, barrier(), jet_cotangents);
  if (body_) terms.body = body_energy<Scalar>(jets, *body_, jet_cotangents);
  if (contact_.size() > 0)
    terms.contact = contact_energy<Scalar>(planes_->planes, planes_->stiffness, u.data() + contact_offset(),
                                           out != nullptr ? out + contact_offset() : nullptr);
  terms.external =
      external_energies<Scalar>(hooks_.energies, problem_.energy_points, jets, hooks_.weight, jet_cotangents);
  return terms;
}

template <class Scalar>
Eigen::VectorX<Scalar> RadialObjective<Scalar>::weighted(const Measurements& u) const {
  Measurements result = Measurements::Zero(u.size());
  const Index n = samples_.size(), pairs = pairs_.sources.rows();
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
  Eigen::Map<PointsOf<Scalar>>(result.data() + handle_offset(), pairs, 3) =
      Scalar(2.0 * handle_weight()) * (pairs_.weights.asDiagonal() * handle_values(u));
  const Index apart = center_offset() - link_offset();
  result.segment(link_offset(), apart) = Scalar(2.0) * u.segment(link_offset(), apart);
  return result;
}

template <class Scalar>
double RadialObjective<Scalar>::value(const Measurements& u, Measurements* cotangents) const {
  const RadialTerms terms = evaluate(u, cotangents);
  const auto apart = u.segment(link_offset(), 3 * links_.rows());
  const auto centers = u.segment(center_offset(), 3 * center_count());
  if (cotangents != nullptr) {
    cotangents->segment(link_offset(), apart.size()) = Scalar(2.0) * apart;
    cotangents->segment(center_offset(), centers.size()) = Scalar(2.0 * coefficient_weight) * centers;
  }
  return terms.arap.energy + handle_weight() * terms.handles + (style_ ? style_->weight * terms.gauss : 0.0) +
         (stance_ ? stance_->weight * terms.stance : 0.0) + barrier() * terms.barrier +
         (body_ ? terms.body.sum() : 0.0) + terms.contact +
         std::accumulate(terms.external.begin(), terms.external.end(), 0.0) +
         static_cast<double>(apart.squaredNorm()) +
         coefficient_weight * static_cast<double>(centers.squaredNorm());
}

template <class Scalar>
RowMatrix<double> RadialObjective<Scalar>::pull_back(const Measurements& cotangents) const {
  RowMatrix<double> gradient = RowMatrix<double>::Zero(center_count() + 4, 3);
  if (blend_.empty()) {
    samples_.pull_back({cotangents.data(), samples_.size(), JetOrder::second}, gradient);
  } else {
    Measurements own = cotangents.head(handle_offset());
    blend_.multiply_transposed({own.data(), samples_.size(), JetOrder::second});
    samples_.pull_back({own.data(), samples_.size(), JetOrder::second}, gradient);
  }
  gradient += handle_basis_.transpose_times(handle_values(cotangents)).template cast<double>();
  if (links_.rows() > 0) {
    const Eigen::Map<const PointsOf<Scalar>> apart(cotangents.data() + link_offset(), links_.rows(), 3);
    gradient += links_.transpose_times(apart).template cast<double>();
  }
  Eigen::Map<Vector>(gradient.data(), 3 * center_count()) +=
      cotangents.segment(center_offset(), 3 * center_count()).template cast<double>();
  if (contact_.size() > 0)
    contact_.pull_back({cotangents.data() + contact_offset(), contact_.size(), JetOrder::value}, gradient);
  if (problem_.mirror) problem_.mirror->symmetrise(gradient);
  return gradient;
}

template <class Scalar>
RowMatrix<double> RadialObjective<Scalar>::pull_back_contact(const PointsOf<Scalar>& cotangents) const {
  RowMatrix<double> gradient = RowMatrix<double>::Zero(center_count() + 4, 3);
  contact_.pull_back({cotangents.data(), contact_.size(), JetOrder::value}, gradient);
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
