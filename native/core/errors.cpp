// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/errors.h"

#include <cmath>
#include <cstdio>

namespace arapfields {

InvalidInput::InvalidInput(std::string_view argument, std::string_view found, std::string_view allowed)
    : std::invalid_argument(std::string(argument).append(": ").append(found).append("; ").append(allowed)) {}

std::string number_text(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%g", value);
  return buffer;
}

void require_range(std::string_view argument, double value, double low, double high) {
  require(std::isfinite(value) && value >= low && value <= high, argument, number_text(value),
          number_text(low) + " to " + number_text(high) + " is allowed");
}

void require_positive(std::string_view argument, double value) {
  require(std::isfinite(value) && value > 0.0, argument, number_text(value),
          std::isnan(value) || value > 0.0 ? "must be positive and finite" : "must be positive");
}

void require_not_negative(std::string_view argument, double value) {
  require(std::isfinite(value) && value >= 0.0, argument, number_text(value),
          value < 0.0 ? "must not be negative" : "must be a finite number, 0 or more");
}

}  // namespace arapfields
