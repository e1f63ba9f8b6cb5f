// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/radial_field.h"

#include <string>

#include "core/errors.h"
#include "fields/radial_sites.h"

namespace arapfields {

RadialField::RadialField(RadialBasis basis, RowMatrix<double> coefficients)
    : basis_(std::move(basis)), coefficients_(std::move(coefficients)) {
  require(basis_.radii.size() == basis_.bumps(), "radii", std::to_string(basis_.radii.size()) + " numbers",
          "one for each of the " + std::to_string(basis_.bumps()) + " centers is needed");
  require(
      coefficients_.rows() == basis_.size() && coefficients_.cols() == 3, "coefficients",
      "shape (" + std::to_string(coefficients_.rows()) + ", " + std::to_string(coefficients_.cols()) + ")",
      "shape (" + std::to_string(basis_.size()) + ", 3) is needed");
  require(basis_.centers.allFinite() && basis_.radii.allFinite() && coefficients_.allFinite() &&
              (basis_.radii.size() == 0 || basis_.radii.minCoeff() > 0.0),
          "radial field", "NaN, infinite numbers or radii that are not positive",
          "finite numbers are needed");
}

void RadialField::evaluate(PointsIn points, JetView<double> out) const {
  RadialSites<double>(basis_, points).evaluate(coefficients_, out);
}

}  // namespace arapfields
