// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/body.h"

#include <string>

#include "core/errors.h"
#include "energies/term.h"

namespace arapfields {

template <class Scalar>
BodyEnergy body_energy(JetView<const Scalar> jets, const Body<Scalar>& body, JetView<Scalar> cotangents) {
  const Index n = jets.count;
  const bool moves = body.inertia > 0.0;
  require(
      body.masses.size() == n && body.rest.rows() == n && (!moves || body.goal.rows() == n), "body",
      std::to_string(body.masses.size()) + " masses",
      "one, with a place at rest and a goal, for each of the " + std::to_string(n) + " samples is needed");
  BodyEnergy energy;
  if (n == 0) return energy;
  const double share = 1.0 / static_cast<double>(n);
  for (Index i = 0; i < n; ++i) {
    const double mass = body.masses[i];
    const Vec3 place = Eigen::Map<const Eigen::Vector3<Scalar>>(jets.at(0, i)).template cast<double>();
    Vec3 slope = -share * mass * body.gravity;
    energy.weight += slope.dot(place - body.rest.row(i).transpose().template cast<double>());
    if (moves) {
      const Vec3 offset = place - body.goal.row(i).transpose().template cast<double>();
      energy.inertia += 0.5 * body.inertia * share * mass * offset.squaredNorm();
      slope += body.inertia * share * mass * offset;
    }
    if (cotangents.data != nullptr)
      Eigen::Map<Eigen::Vector3<Scalar>>(cotangents.at(0, i)) += slope.template cast<Scalar>();
  }
  return energy;
}

namespace {

class BodyTerm final : public JetTermOf<BodyTerm> {
 public:
  explicit BodyTerm(const Body<double>& body)
      : exact_(body),
        single_{body.masses.cast<float>(), body.rest.cast<float>(), body.goal.cast<float>(), body.inertia,
                body.gravity} {}
  std::string name() const override { return "motion"; }
  JetOrder order() const override { return JetOrder::value; }
  void set_batch(const TermBatch&) override {}
  template <class Scalar>
  double value(const JetView<const Scalar>& jets, const JetView<Scalar>& cotangents) const {
    if constexpr (std::is_same_v<Scalar, float>)
      return body_energy<float>(jets, single_, cotangents).sum();
    else
      return body_energy<double>(jets, exact_, cotangents).sum();
  }

 private:
  Body<double> exact_;
  Body<float> single_;
};

}  // namespace

std::shared_ptr<JetTerm> body_term(const Body<double>& body) { return std::make_shared<BodyTerm>(body); }

#define ARAPFIELDS_BODY(Scalar) \
  template BodyEnergy body_energy<Scalar>(JetView<const Scalar>, const Body<Scalar>&, JetView<Scalar>);
ARAPFIELDS_BODY(float)
ARAPFIELDS_BODY(double)

}  // namespace arapfields
