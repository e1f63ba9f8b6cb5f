// SPDX-License-Identifier: GPL-3.0-or-later
// Every tensor operation on the same numbers, for one backend to be compared with another.
#pragma once

#include <string>
#include <vector>

/// Outside of the namespaces of the two backends, which share it.
struct OperationResult {
  std::string name;
  std::vector<double> values;
};

namespace arapfields {

std::vector<OperationResult> run_tensor_operations(bool double_precision);

}  // namespace arapfields
