// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/locality.h"

#include <cmath>

#include "energies/composed_energies.h"
#include "energies/ranges.h"
#include "energies/term.h"
#include "tensors/operations.h"
#include "tensors/views.h"

namespace arapfields {
namespace {

class LocalityTerm final : public JetTermOf<LocalityTerm> {
 public:
  explicit LocalityTerm(Locality locality) : locality_(std::move(locality)) {}
  std::string name() const override { return "locality"; }
  JetOrder order() const override { return JetOrder::value; }

  void set_batch(const TermBatch& batch) override {
    const Mat4& motion = locality_.motion;
    places_ = PointsInBoth((batch.points * motion.topLeftCorner<3, 3>().transpose()).rowwise() +
                           motion.topRightCorner<3, 1>().transpose());
    Vector shares = Vector::Ones(batch.points.rows()), scales = shares;
    if (batch.weights.size() > 0) shares = batch.weights.cwiseMin(1.0);
    if (locality_.shares.size() > 0)
      for (Index i = 0; i < shares.size(); ++i) {
        const Index row = batch.rows.empty() ? i : batch.rows[static_cast<std::size_t>(i)];
        shares[i] *= row >= 0 ? locality_.shares[row] : 0.0;
        if (row >= 0 && locality_.sizes.size() > 0) scales[i] = 1.0 / locality_.sizes[row];
      }
    shares_ = VectorInBoth(shares);
    scales_ = VectorInBoth(scales);
  }

  template <class Scalar>
  double value(const JetView<const Scalar>& jets, const JetView<Scalar>& cotangents) const {
    const auto& [weight, limit, smoothing] = locality_.options;
    const auto& places = places_.in<Scalar>();
    const auto& shares = shares_.in<Scalar>();
    const auto& scales = scales_.in<Scalar>();
    const double share = weight / static_cast<double>(std::max<Index>(jets.count, 1));
    const auto c = static_cast<Scalar>(limit), e = static_cast<Scalar>(smoothing);
    return share * limit * sum_over_ranges<1>(jets.count, [&](Index begin, Index end, double* sum) {
             for (Index i = begin; i < end; ++i) {
               const Eigen::Vector3<Scalar> off =
                   scales[i] *
                   (Eigen::Map<const Eigen::Vector3<Scalar>>(jets.at(0, i)) - places.row(i).transpose());
               const Scalar square = off.squaredNorm(), length = std::sqrt(square + e * e);
               const Scalar rho = square / (length + e);  // length − e without cancellation
               const Scalar left = std::exp(-rho / c);
               *sum += static_cast<double>(-shares[i] * std::expm1(-rho / c));
               if (cotangents.data != nullptr)
                 Eigen::Map<Eigen::Vector3<Scalar>>(cotangents.at(0, i)) +=
                     static_cast<Scalar>(share) * shares[i] * scales[i] * left / length * off;
             }
           })[0];
  }

  Tensor compose(const Tensor& jets, const EnergyTables&, Tensor cotangents,
                 std::vector<ComposedPart>& parts) const override {
    const auto& [weight, limit, smoothing] = locality_.options;
    const double share = weight / static_cast<double>(std::max<Index>(jets.size(1), 1));
    const Tensor scales = tensor_like(scales_.in<double>(), jets).unsqueeze(1);
    const Tensor off = scales * (jets[0] - tensor_like(places_.in<double>(), jets));
    const Tensor shares = tensor_like(shares_.in<double>(), jets).unsqueeze(1);
    const Tensor squares = sum(off * off, {-1}, true);
    const Tensor length = sqrt(squares + smoothing * smoothing);
    const Tensor left = exp(squares / (length + smoothing) * (-1.0 / limit));
    if (cotangents.defined()) cotangents[0].add(scales * shares * left / length * off, share);
    parts.push_back({name(), sum(shares * (1.0 - left)) * (share * limit)});
    return parts.back().value;
  }

 private:
  Locality locality_;
  PointsInBoth places_;
  VectorInBoth shares_;
  VectorInBoth scales_;  // 1 / size
};

}  // namespace

std::shared_ptr<JetTerm> locality_term(Locality locality) {
  return std::make_shared<LocalityTerm>(std::move(locality));
}

}  // namespace arapfields
