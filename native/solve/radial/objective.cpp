// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/objective.h"

#include <numeric>

#include "core/errors.h"
#include "energies/distortion.h"

namespace arapfields {
namespace {

/// Pull of each bump's coefficient towards zero: removes what no sample can see, and no more.
constexpr double coefficient_weight = 1e-10;

}  // namespace

template <class Scalar>
RadialObjective<Scalar>::RadialObjective(const RadialBasis& basis, PointsIn samples, double handle_weight)
    : center_count_(basis.center_count()), handle_weight_(handle_weight), samples_(basis, samples) {}

template <class Scalar>
void RadialObjective<Scalar>::set_stiffness(const Vector& bending, const Vector& weights) {
  bending_ = bending.cast<Scalar>();
  weights_ = weights.cast<Scalar>();
}

template <class Scalar>
void RadialObjective<Scalar>::set_barrier(double weight, double threshold) {
  barrier_ = weight;
  barrier_threshold_ = threshold;
}

template <class Scalar>
void RadialObjective<Scalar>::set_handles(const HandleBatch<double>& pairs,
                                          const RowMatrix<double>& values_of_basis,
                                          const RowMatrix<double>& inverse_factor) {
  pairs_ = {pairs.sources.cast<Scalar>(), pairs.targets.cast<Scalar>(), pairs.weights.cast<Scalar>()};
  handle_basis_ = TallMatrix<Scalar>(values_of_basis);
  inverse_factor_ = TallMatrix<float>(inverse_factor, true);
}

template <class Scalar>
void RadialObjective<Scalar>::set_targets(PointsIn targets) {
  require(targets.rows() == pairs_.sources.rows(), "targets", std::to_string(targets.rows()) + " rows",
          std::to_string(pairs_.sources.rows()) + " are needed");
  pairs_.targets = targets.cast<Scalar>();
}

template <class Scalar>
void RadialObjective<Scalar>::set_style(const std::optional<RadialStyle>& style) {
  style_ = style;
  if (!style) return;
  style_normals_ = style->normals.template cast<Scalar>();
  style_targets_ = style->style.targets.template cast<Scalar>();
  style_weights_ = style->style.weights.template cast<Scalar>();
}

template <class Scalar>
void RadialObjective<Scalar>::set_hooks(const RadialHooks& hooks, PointsIn rest) {
  hooks_ = hooks;
  rest_ = rest;
}

template <class Scalar>
bool RadialObjective<Scalar>::accepted(const Measurements& u) const {
  if (!hooks_.observer) return true;
  const RadialTerms terms = evaluate(u, nullptr);
  std::vector<LossTerm> told{{"stretch", terms.arap.stretch_energy}};
  if ((bending_.array() > 0).any()) told.push_back({"bend", terms.arap.energy - terms.arap.stretch_energy});
  if (style_) told.push_back({"style", style_->weight * terms.gauss});
  if (stance_) told.push_back({"stance", stance_->weight * terms.stance});
  if (barrier_ > 0.0) told.push_back({"barrier", barrier_ * terms.barrier});
  if (body_) told.push_back({"motion", terms.body.sum()});
  told.push_back({"handles", handle_weight_ * terms.handles});
  for (std::size_t i = 0; i < terms.external.size(); ++i)
    told.push_back({"energies[" + std::to_string(i) + "]", terms.external[i]});
  return hooks_.observer(told);
}

template <class Scalar>
void RadialObjective<Scalar>::set_stance(const std::optional<RadialStance>& stance) {
  stance_ = stance;
  if (stance) stance_rest_ = stance->rest.template cast<Scalar>();
}

template <class Scalar>
void RadialObjective<Scalar>::measure(const RowMatrix<double>& c, Measurements& u) const {
  u.resize(center_offset() + 3 * center_count_);
  samples_.evaluate(c, {u.data(), samples_.size(), JetOrder::second});
  blend_.multiply({u.data(), samples_.size(), JetOrder::second});
  const PointsOf<Scalar> rounded = c.cast<Scalar>();
  Eigen::Map<PointsOf<Scalar>>(u.data() + handle_offset(), pairs_.sources.rows(), 3) =
      handle_basis_.times(rounded);
  u.tail(3 * center_count_) = Eigen::Map<const Measurements>(rounded.data(), 3 * center_count_);
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
      handle_energy<Scalar>({u.data() + handle_offset(), pairs, JetOrder::value}, pairs_, handle_weight_,
                            {out != nullptr ? out + handle_offset() : nullptr, pairs, JetOrder::value});
  if (style_)
    terms.gauss = style_energy<Scalar>(jets, style_normals_, style_->style.preference, style_targets_,
                                       style_weights_, style_->weight, jet_cotangents);
  if (stance_)
    terms.stance =
        stance_energy<Scalar>(jets, stance_rest_, stance_->stance, stance_->weight, jet_cotangents);
  if (barrier_ > 0.0)
    terms.barrier = fold_barrier<Scalar>(jets, barrier_threshold_, barrier_, jet_cotangents);
  if (body_) terms.body = body_energy<Scalar>(jets, *body_, jet_cotangents);
  terms.external = external_energies<Scalar>(hooks_.energies, rest_, jets, hooks_.weight, jet_cotangents);
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
      Scalar(2.0 * handle_weight_) * (pairs_.weights.asDiagonal() * handle_values(u));
  return result;
}

template <class Scalar>
double RadialObjective<Scalar>::value(const Measurements& u, Measurements* cotangents) const {
  const RadialTerms terms = evaluate(u, cotangents);
  const auto centers = u.tail(3 * center_count_);
  if (cotangents != nullptr) cotangents->tail(3 * center_count_) = Scalar(2.0 * coefficient_weight) * centers;
  return terms.arap.energy + handle_weight_ * terms.handles + (style_ ? style_->weight * terms.gauss : 0.0) +
         (stance_ ? stance_->weight * terms.stance : 0.0) + barrier_ * terms.barrier +
         (body_ ? terms.body.sum() : 0.0) +
         std::accumulate(terms.external.begin(), terms.external.end(), 0.0) +
         coefficient_weight * static_cast<double>(centers.squaredNorm());
}

template <class Scalar>
RowMatrix<double> RadialObjective<Scalar>::pull_back(const Measurements& cotangents) const {
  RowMatrix<double> gradient = RowMatrix<double>::Zero(center_count_ + 4, 3);
  if (blend_.empty()) {
    samples_.pull_back({cotangents.data(), samples_.size(), JetOrder::second}, gradient);
  } else {
    Measurements own = cotangents.head(handle_offset());
    blend_.multiply_transposed({own.data(), samples_.size(), JetOrder::second});
    samples_.pull_back({own.data(), samples_.size(), JetOrder::second}, gradient);
  }
  gradient += handle_basis_.transpose_times(handle_values(cotangents)).template cast<double>();
  Eigen::Map<Vector>(gradient.data(), 3 * center_count_) +=
      cotangents.tail(3 * center_count_).template cast<double>();
  if (mirror_) mirror_->symmetrise(gradient);
  return gradient;
}

template <class Scalar>
RowMatrix<double> RadialObjective<Scalar>::precondition(const RowMatrix<double>& gradient) const {
  const double size = gradient.norm();
  if (!(size > 0.0)) return gradient;
  const PointsF scaled = (gradient / size).cast<float>();
  RowMatrix<double> step =
      (0.5 * size) * inverse_factor_.transpose_times(inverse_factor_.times(scaled)).cast<double>();
  if (mirror_) mirror_->symmetrise(step);
  return step;
}

template class RadialObjective<float>;
template class RadialObjective<double>;

}  // namespace arapfields
