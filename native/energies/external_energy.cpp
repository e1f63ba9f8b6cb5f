// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/external_energy.h"

#include <cmath>
#include <string>

namespace arapfields {

ExternalEnergy::~ExternalEnergy() = default;

JetOrder highest_order(const ExternalEnergies& energies, JetOrder own) {
  for (const auto& energy : energies)
    if (columns(energy->order()) > columns(own)) own = energy->order();
  return own;
}

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

template std::vector<double> external_energies(const ExternalEnergies&, PointsIn, const JetView<const float>&,
                                               double, const JetView<float>&);
template std::vector<double> external_energies(const ExternalEnergies&, PointsIn,
                                               const JetView<const double>&, double, const JetView<double>&);

}  // namespace arapfields
