// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <boost/test/unit_test.hpp>
#include <cmath>

#include "backends/tensor_operations.h"

#ifdef ARAPFIELDS_WITH_TORCH
/// The Eigen backend, compiled beside libtorch's under another name.
namespace arapfields_eigen {
std::vector<OperationResult> run_tensor_operations(bool double_precision);
}
#endif

namespace arapfields {
namespace {

/// Of the largest number of a result. Sums of up to 300 products round differently in another order; factors
/// and solutions are of well conditioned matrices.
constexpr double single_tolerance = 1e-5, double_tolerance = 1e-12;

using Results = std::vector<OperationResult>;

void compare(const Results& found, const Results& expected, double tolerance) {
  BOOST_REQUIRE_EQUAL(found.size(), expected.size());
  for (std::size_t k = 0; k < found.size(); ++k) {
    const std::vector<double>&a = found[k].values, &b = expected[k].values;
    BOOST_REQUIRE_MESSAGE(found[k].name == expected[k].name && a.size() == b.size(), expected[k].name);
    double size = 1.0, off = 0.0;
    for (const double value : b) size = std::max(size, std::abs(value));
    for (std::size_t i = 0; i < a.size(); ++i)
      off = std::max(off, a[i] == b[i] ? 0.0 : std::abs(a[i] - b[i]));
    BOOST_CHECK_MESSAGE(off <= tolerance * size, expected[k].name << " (" << k << "): off by " << off / size);
  }
}

}  // namespace

BOOST_AUTO_TEST_SUITE(tensors)

BOOST_AUTO_TEST_CASE(single_precision_agrees_with_double) {
  Results single = run_tensor_operations(false), wide = run_tensor_operations(true);
  const auto rounded = [](const OperationResult& result) {
    return result.name.find("bfloat16") != std::string::npos;
  };
  std::erase_if(single, rounded);  // where two steps of rounding may go either way
  std::erase_if(wide, rounded);
  compare(single, wide, single_tolerance);
}

#ifdef ARAPFIELDS_WITH_TORCH
BOOST_AUTO_TEST_CASE(the_backends_agree_in_single_precision) {
  compare(arapfields_eigen::run_tensor_operations(false), run_tensor_operations(false), single_tolerance);
}

BOOST_AUTO_TEST_CASE(the_backends_agree_in_double_precision) {
  compare(arapfields_eigen::run_tensor_operations(true), run_tensor_operations(true), double_tolerance);
}
#endif

BOOST_AUTO_TEST_SUITE_END()

}  // namespace arapfields
