// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/external_energy.h"

#include <cmath>
#include <numeric>
#include <string>

#include "energies/term.h"

namespace arapfields {

ExternalEnergy::~ExternalEnergy() = default;

template <class Scalar>
std::vector<double> external_energies(const ExternalEnergies& energies, PointsIn points,
                                      const JetView<const Scalar>& jets, double weight,
                                      const JetView<Scalar>& cotangents) {
  std::vector<double> values;
  if (energies.empty()) return values;
  const Vector wide =
      Eigen::Map<const Eigen::VectorX<Scalar>>(jets.data, jets.size()).template cast<double>();
  for (std::size_t i = 0; i < energies.size(); ++i) {
    const JetOrder order = energies[i]->order();
    JetBlock<double> own(jets.count, order);
    const JetView<double> derivatives_view = own.view();
    const double value = energies[i]->evaluate(points, {wide.data(), jets.count, order}, derivatives_view);
    const Eigen::Map<const Vector> derivatives(derivatives_view.data, derivatives_view.size());
    const std::string name = "energies[" + std::to_string(i) + "]";
    require(!std::isnan(value), name, "its value is NaN", "a number is needed");
    require(!std::isfinite(value) || derivatives.allFinite(), name,
            "its derivatives are NaN or infinite where its value is " + number_text(value),
            "finite ones are needed");
    if (cotangents.data != nullptr)
      Eigen::Map<Eigen::VectorX<Scalar>>(cotangents.data, derivatives_view.size()) +=
          (weight * derivatives).template cast<Scalar>();
    values.push_back(weight * value);
  }
  return values;
}

namespace {

class ExternalTerm final : public JetTerm {
 public:
  ExternalTerm(ExternalEnergies energies, double weight) : energies_(std::move(energies)), weight_(weight) {}
  std::string name() const override { return "energies"; }
  JetOrder order() const override {
    JetOrder highest = JetOrder::first;
    for (const auto& energy : energies_)
      if (columns(energy->order()) > columns(highest)) highest = energy->order();
    return highest;
  }
  void set_batch(const TermBatch& batch) override { points_ = batch.points; }
  double evaluate(const JetView<const float>& jets, const JetView<float>& cotangents,
                  std::vector<LossTerm>* parts) const override {
    return sum_of(external_energies<float>(energies_, points_, jets, weight_, cotangents), parts);
  }
  double evaluate(const JetView<const double>& jets, const JetView<double>& cotangents,
                  std::vector<LossTerm>* parts) const override {
    return sum_of(external_energies<double>(energies_, points_, jets, weight_, cotangents), parts);
  }

 private:
  static double sum_of(const std::vector<double>& values, std::vector<LossTerm>* parts) {
    for (std::size_t i = 0; parts != nullptr && i < values.size(); ++i)
      parts->push_back({"energies[" + std::to_string(i) + "]", values[i]});
    return std::accumulate(values.begin(), values.end(), 0.0);
  }

  ExternalEnergies energies_;
  double weight_;
  Points points_;
};

}  // namespace

std::shared_ptr<JetTerm> external_term(ExternalEnergies energies, double weight) {
  return std::make_shared<ExternalTerm>(std::move(energies), weight);
}

template std::vector<double> external_energies(const ExternalEnergies&, PointsIn, const JetView<const float>&,
                                               double, const JetView<float>&);
template std::vector<double> external_energies(const ExternalEnergies&, PointsIn,
                                               const JetView<const double>&, double, const JetView<double>&);

}  // namespace arapfields
