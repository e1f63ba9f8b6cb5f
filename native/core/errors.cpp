// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/errors.h"

#include <cmath>
#include <cstdio>

namespace arapfields {

std::string number_text(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%g", value);
  return buffer;
}

void require_range(const std::string& argument, double value, double low, double high) {
  require(std::isfinite(value) && value >= low && value <= high, argument, number_text(value),
          number_text(low) + " to " + number_text(high) + " is allowed");
}

void require_positive(const std::string& argument, double value) {
  require(std::isfinite(value) && value > 0.0, argument, number_text(value), "must be positive");
}

void require_not_negative(const std::string& argument, double value) {
  require(std::isfinite(value) && value >= 0.0, argument, number_text(value), "must not be negative");
}

}  // namespace arapfields
