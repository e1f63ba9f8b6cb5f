// SPDX-License-Identifier: GPL-3.0-or-later
#include "sampling/evaluation_counter.h"

#include <algorithm>

#include "core/errors.h"
#include "core/random.h"

namespace arapfields {
namespace {

constexpr Index batch = 8192;  // a 4×256 network takes some 30 ms for these
constexpr double lipschitz_safety = 1.25;

void require_finite(bool finite) {
  require(finite, "sdf", "its values or gradients are NaN or infinite in the cube [-1, 1]^3",
          "a finite implicit function is needed");
}

}  // namespace

VectorF EvaluationCounter::values(ConstPointsRef<float> points) {
  VectorF result(points.rows());
  for (Index begin = 0; begin < points.rows(); begin += batch) {
    progress_.check();
    const Index size = std::min<Index>(batch, points.rows() - begin);
    function_.evaluate(points.middleRows(begin, size), result.segment(begin, size));
  }
  value_count_ += points.rows();
  require_finite(result.allFinite());
  return result;
}

VectorF EvaluationCounter::values(ConstPointsRef<float> points, PointsF& gradients) {
  VectorF result(points.rows());
  gradients.resize(points.rows(), 3);
  for (Index begin = 0; begin < points.rows(); begin += batch / 4) {
    progress_.check();
    const Index size = std::min<Index>(batch / 4, points.rows() - begin);
    function_.evaluate(points.middleRows(begin, size), result.segment(begin, size),
                       gradients.middleRows(begin, size));
  }
  gradient_count_ += points.rows();
  require_finite(result.allFinite() && gradients.allFinite());
  return result;
}

double measure_lipschitz(EvaluationCounter& function, int strata) {
  PointsF points(static_cast<Index>(strata) * strata * strata, 3);
  Random random(0, 0x11b5);
  Index row = 0;
  for (int i = 0; i < strata; ++i)
    for (int j = 0; j < strata; ++j)
      for (int k = 0; k < strata; ++k, ++row)
        for (int axis = 0; axis < 3; ++axis) {
          const int cell = axis == 0 ? i : axis == 1 ? j : k;
          points(row, axis) = static_cast<float>((cell + random.uniform()) * 2.0 / strata - 1.0);
        }
  PointsF gradients;
  function.values(points, gradients);
  VectorF slopes = gradients.rowwise().norm();
  const auto largest = function.continuous() ? slopes.end() - 1 : slopes.begin() + slopes.size() * 9 / 10;
  std::nth_element(slopes.begin(), largest, slopes.end());
  return lipschitz_safety * std::max(1e-6, static_cast<double>(*largest));
}

}  // namespace arapfields
