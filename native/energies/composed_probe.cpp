// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/composed_probe.h"

#include "energies/composed_energies.h"
#include "tensors/views.h"

namespace arapfields {
template <class Scalar>
ArapValue probe_arap(JetView<const Scalar> jets, double bending, double weight, JetView<Scalar> cotangents,
                     ArapFactors<Scalar> factors) {
  const Tensor given = tensor_view(jets);
  const auto per_point = [&](const Scalar* numbers) {
    if (numbers == nullptr) return Tensor();
    return tensor_view(numbers, {jets.count});
  };
  const ComposedFactors own{per_point(factors.weights), per_point(factors.bending)};
  const Tensor values =
      composed_arap(given, bending, weight, EnergyTables(given), tensor_view(cotangents), own)
          .to(NumberType::float64);
  return {values[0].number(), values[1].number(), values[2].number()};
}

template <class Scalar>
double probe_gauss(JetView<const Scalar> jets, ConstPointsRef<Scalar> normals,
                   const Eigen::Ref<const Eigen::VectorX<Scalar>>& sample_weights,
                   const GaussPreference& preference, double weight, JetView<Scalar> cotangents) {
  const Tensor given = tensor_view(jets);
  RowMatrix<double> rows(preference.normals.rows(), 4);
  rows << preference.normals, preference.weights;
  const Tensor weights = sample_weights.size() > 0 ? tensor_view(sample_weights) : Tensor();
  return composed_gauss(given, tensor_view(normals), weights, tensor_view(rows).to(given.type()),
                        preference.sharpness, weight, EnergyTables(given), tensor_view(cotangents))
      .number();
}

template <class Scalar>
double probe_targets(JetView<const Scalar> jets, ConstPointsRef<Scalar> normals,
                     ConstPointsRef<Scalar> targets,
                     const Eigen::Ref<const Eigen::VectorX<Scalar>>& sample_weights, double weight,
                     JetView<Scalar> cotangents) {
  const Tensor given = tensor_view(jets);
  const Tensor weights = sample_weights.size() > 0 ? tensor_view(sample_weights) : Tensor();
  return composed_targets(given, tensor_view(normals), weights, tensor_view(targets), weight,
                          EnergyTables(given), tensor_view(cotangents))
      .number();
}

template <class Scalar>
double probe_barrier(JetView<const Scalar> jets, double threshold, double weight,
                     JetView<Scalar> cotangents) {
  const Tensor given = tensor_view(jets);
  return composed_barrier(given, threshold, weight, EnergyTables(given), tensor_view(cotangents)).number();
}

template <class Scalar>
double probe_handles(JetView<const Scalar> jets, const HandleBatch<Scalar>& batch, double weight,
                     JetView<Scalar> cotangents) {
  return composed_handles(tensor_view(jets), tensor_view(batch.targets), tensor_view(batch.weights), weight,
                          tensor_view(cotangents))
      .number();
}

template <class Scalar>
double probe_stance(JetView<const Scalar> jets, ConstPointsRef<Scalar> rest, const Stance& stance,
                    double weight, JetView<Scalar> cotangents) {
  const Tensor given = tensor_view(jets);
  const Vector up = stance.up;
  return stance.scale * composed_stance(given, tensor_view(rest), tensor_view(up).to(given.type()),
                                        tensor_view(stance.ground).to(given.type()), weight * stance.scale,
                                        EnergyTables(given), tensor_view(cotangents))
                            .number();
}

#define ARAPFIELDS_PROBES(Scalar)                                                                            \
  template ArapValue probe_arap<Scalar>(JetView<const Scalar>, double, double, JetView<Scalar>,              \
                                        ArapFactors<Scalar>);                                                \
  template double probe_gauss<Scalar>(JetView<const Scalar>, ConstPointsRef<Scalar>,                         \
                                      const Eigen::Ref<const Eigen::VectorX<Scalar>>&,                       \
                                      const GaussPreference&, double, JetView<Scalar>);                      \
  template double probe_targets<Scalar>(                                                                     \
      JetView<const Scalar>, ConstPointsRef<Scalar>, ConstPointsRef<Scalar>,                                 \
      const Eigen::Ref<const Eigen::VectorX<Scalar>>&, double, JetView<Scalar>);                             \
  template double probe_barrier<Scalar>(JetView<const Scalar>, double, double, JetView<Scalar>);             \
  template double probe_handles<Scalar>(JetView<const Scalar>, const HandleBatch<Scalar>&, double,           \
                                        JetView<Scalar>);                                                    \
  template double probe_stance<Scalar>(JetView<const Scalar>, ConstPointsRef<Scalar>, const Stance&, double, \
                                       JetView<Scalar>);
ARAPFIELDS_PROBES(float)
ARAPFIELDS_PROBES(double)

}  // namespace arapfields
