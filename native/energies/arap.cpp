// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/arap.h"

#include <vector>

#include "core/errors.h"
#include "energies/composed_energies.h"
#include "energies/kernels.h"
#include "energies/ranges.h"
#include "energies/rotation.h"
#include "energies/term.h"
#include "tensors/views.h"

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

namespace {

class ArapTerm final : public JetTerm {
 public:
  ArapTerm(double weight, bool bends) : weight_(weight), bends_(bends) {}
  std::string name() const override { return "arap"; }
  JetOrder order() const override { return bends_ ? JetOrder::second : JetOrder::first; }
  void set_batch(const TermBatch& batch) override {
    weights_ = VectorInBoth(batch.weights);
    bending_ = VectorInBoth(batch.bending);
    lists_bend_ = bends_ && (batch.bending.array() > 0.0).any();
  }
  double evaluate(const JetView<const float>& jets, const JetView<float>& cotangents,
                  std::vector<LossTerm>* parts) const override {
    return value(jets, cotangents, parts);
  }
  double evaluate(const JetView<const double>& jets, const JetView<double>& cotangents,
                  std::vector<LossTerm>* parts) const override {
    return value(jets, cotangents, parts);
  }
  Tensor compose(const Tensor& jets, const EnergyTables& tables, Tensor cotangents,
                 std::vector<ComposedPart>& parts) const override {
    const Vector& weights = weights_.in<double>();
    const ComposedFactors factors{weights.size() > 0 ? tensor_like(weights, jets) : Tensor(),
                                  tensor_like(bending_.in<double>(), jets)};
    const Tensor means = composed_arap(jets, bends_ ? 1.0 : 0.0, weight_, tables, cotangents, factors);
    parts.push_back({"stretch", weight_ * means[3]});
    if (lists_bend_) parts.push_back({"bend", weight_ * (means[2] - means[3])});
    return weight_ * means[2];
  }

 private:
  template <class Scalar>
  double value(const JetView<const Scalar>& jets, const JetView<Scalar>& cotangents,
               std::vector<LossTerm>* parts) const {
    const auto& weights = weights_.in<Scalar>();
    const ArapValue means =
        arap_energy<Scalar>(jets, bends_ ? 1.0 : 0.0, weight_, cotangents,
                            {weights.size() > 0 ? weights.data() : nullptr, bending_.in<Scalar>().data()});
    if (parts != nullptr) {
      parts->push_back({"stretch", weight_ * means.stretch_energy});
      if (lists_bend_) parts->push_back({"bend", weight_ * (means.energy - means.stretch_energy)});
    }
    return weight_ * means.energy;
  }

  double weight_;
  bool bends_;
  bool lists_bend_ = false;  // whether any sample resists bending
  VectorInBoth weights_;     // may be empty
  VectorInBoth bending_;
};

}  // namespace

std::shared_ptr<JetTerm> arap_term(double weight, bool bends) {
  return std::make_shared<ArapTerm>(weight, bends);
}

template ArapValue arap_energy<float>(JetView<const float>, double, double, JetView<float>,
                                      ArapFactors<float>);
template ArapValue arap_energy<double>(JetView<const double>, double, double, JetView<double>,
                                       ArapFactors<double>);
template void closest_rotations<float>(const float*, Index, float*);
template void closest_rotations<double>(const double*, Index, double*);

}  // namespace arapfields
