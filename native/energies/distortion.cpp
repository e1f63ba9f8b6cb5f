// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/distortion.h"

#include <algorithm>
#include <cmath>

#include "core/errors.h"
#include "core/jets.h"
#include "energies/composed_energies.h"
#include "energies/kernels.h"
#include "energies/ranges.h"
#include "energies/term.h"
#include "tensors/views.h"

namespace arapfields {
namespace {

class BarrierTerm final : public JetTermOf<BarrierTerm> {
 public:
  BarrierTerm(double threshold, double weight) : threshold_(threshold), weight_(weight) {}
  std::string name() const override { return "barrier"; }
  JetOrder order() const override { return JetOrder::first; }
  void set_batch(const TermBatch&) override {}
  template <class Scalar>
  double value(const JetView<const Scalar>& jets, const JetView<Scalar>& cotangents) const {
    return weight_ * fold_barrier<Scalar>(jets, threshold_, weight_, cotangents);
  }
  Tensor compose(const Tensor& jets, const EnergyTables& tables, Tensor cotangents,
                 std::vector<ComposedPart>& parts) const override {
    parts.push_back({name(), weight_ * composed_barrier(jets, threshold_, weight_, tables, cotangents)});
    return parts.back().value;
  }

 private:
  double threshold_;
  double weight_;
};

}  // namespace

template <class Scalar>
Distortion distortion(JetView<const Scalar> jets) {
  require(jets.order != JetOrder::value, "jets", "values alone", "first derivatives are needed");
  Distortion result;
  if (jets.count == 0) return result;
  std::vector<Distortion> parts((jets.count + range_size - 1) / range_size);
  for_ranges(jets.count, [&](Index begin, Index end) {
    double values[4] = {INFINITY, 0.0, 0.0, INFINITY};
    ARAPFIELDS_DISPATCH(distortion_range(jets.data, jets.count, begin, end, values));
    const Distortion part{values[0], values[1], values[2], values[3]};
    parts[begin / range_size] = part;
  });
  result = {INFINITY, 0.0, 0.0, INFINITY};
  for (const Distortion& part : parts) {
    result.min_determinant = std::min(result.min_determinant, part.min_determinant);
    result.flipped_share += part.flipped_share / static_cast<double>(jets.count);
    result.max_stretch = std::max(result.max_stretch, part.max_stretch);
    result.min_stretch = std::min(result.min_stretch, part.min_stretch);
  }
  return result;
}

template <class Scalar>
double fold_barrier(JetView<const Scalar> jets, double threshold, double weight, JetView<Scalar> cotangents) {
  require(jets.order != JetOrder::value, "jets", "values alone", "first derivatives are needed");
  require(threshold > 0.0 && std::isfinite(threshold), "threshold", std::to_string(threshold),
          "must be positive");
  require(
      cotangents.data == nullptr || (cotangents.count == jets.count && cotangents.order != JetOrder::value),
      "cotangents", "another shape than the jets'", "as many points and first derivatives are needed");
  if (jets.count == 0) return 0.0;
  const double n = static_cast<double>(jets.count);
  const auto sums = sum_over_ranges<1>(jets.count, [&](Index begin, Index end, double* out) {
    for (Index p = begin; p < end; ++p) {
      const Mat3 j = jacobian_at(jets, p);
      const Mat3 minors = cofactors(j);
      const double gap = 1.0 - minors.col(0).dot(j.col(0)) / threshold;
      if (gap <= 0.0) continue;
      out[0] += gap * gap;
      if (cotangents.data == nullptr) continue;
      const Mat3 gradient = (-2.0 * gap / threshold * weight / n) * minors;
      for (int k = 0; k < 3; ++k)
        for (int i = 0; i < 3; ++i)
          cotangents.at(first_column(k), p)[i] += static_cast<Scalar>(gradient(i, k));
    }
  });
  return sums[0] / n;
}

std::shared_ptr<JetTerm> barrier_term(double threshold, double weight) {
  return std::make_shared<BarrierTerm>(threshold, weight);
}

template Distortion distortion<float>(JetView<const float>);
template Distortion distortion<double>(JetView<const double>);
template double fold_barrier<float>(JetView<const float>, double, double, JetView<float>);
template double fold_barrier<double>(JetView<const double>, double, double, JetView<double>);

}  // namespace arapfields
