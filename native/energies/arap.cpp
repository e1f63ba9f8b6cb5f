// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/arap.h"

#include <vector>

#include "core/errors.h"
#include "energies/kernels.h"
#include "energies/ranges.h"
#include "energies/rotation.h"

namespace arapfields {

template <class Scalar>
ArapValue arap_energy(JetView<const Scalar> jets, double bending, double weight, JetView<Scalar> cotangents,
                      ArapFactors<Scalar> factors) {
  require(jets.order != JetOrder::value && (jets.order == JetOrder::second || bending == 0.0), "jets",
          std::to_string(columns(jets.order)) + " columns",
          "the energy needs first derivatives, and second ones where bending is not 0");
  const bool second_cotangents = bending != 0.0;
  if (cotangents.data != nullptr)
    require(cotangents.count == jets.count && columns(cotangents.order) >= (second_cotangents ? 10 : 4),
            "cotangents",
            std::to_string(columns(cotangents.order)) + " columns for " + std::to_string(cotangents.count) +
                " points",
            "as many points and columns as the jets' are needed");
  if (jets.count == 0) return {};
  const double n = static_cast<double>(jets.count);
  const ArapBlock<Scalar> block{jets.data,
                                cotangents.data,
                                jets.count,
                                jets.order == JetOrder::second,
                                second_cotangents,
                                static_cast<Scalar>(weight / n),
                                static_cast<Scalar>(weight * bending / n),
                                static_cast<Scalar>(bending),
                                factors.weights,
                                factors.bending};
  const auto sums = sum_over_ranges<4>(jets.count, [&](Index begin, Index end, double* out) {
    ARAPFIELDS_DISPATCH(arap_range(block, begin, end, out));
  });
  return {sums[0] / n, sums[1] / n, sums[2] / n, sums[3] / n};
}

template <class Scalar>
void closest_rotations(const Scalar* jacobians, Index count, Scalar* rotations) {
  for_ranges(count, [&](Index begin, Index end) {
    ARAPFIELDS_DISPATCH(rotation_range(jacobians, count, begin, end, rotations));
  });
}

Mat3 closest_rotation(const Mat3& jacobian) {
  Mat3 result;  // one point's block is its columns one after another, as Eigen stores them
  ARAPFIELDS_DISPATCH(rotation_range(jacobian.data(), 1, 0, 1, result.data()));
  return result;
}

template ArapValue arap_energy<float>(JetView<const float>, double, double, JetView<float>,
                                      ArapFactors<float>);
template ArapValue arap_energy<double>(JetView<const double>, double, double, JetView<double>,
                                       ArapFactors<double>);
template void closest_rotations<float>(const float*, Index, float*);
template void closest_rotations<double>(const double*, Index, double*);

}  // namespace arapfields
