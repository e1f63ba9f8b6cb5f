// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/aten_probe.h"

#include <ATen/ATen.h>

#include "energies/aten_energies.h"

namespace arapfields {
namespace {

template <class Scalar>
at::Tensor matrix_of(const Scalar* data, Index rows, Index columns) {
  return at::from_blob(const_cast<Scalar*>(data), {rows, columns}, c10::CppTypeToScalarType<Scalar>::value);
}

template <class Scalar>
at::Tensor tensor_of(JetView<Scalar> jets) {
  return matrix_of(jets.data, columns(jets.order) * jets.count, 3).view({columns(jets.order), jets.count, 3});
}

}  // namespace

template <class Scalar>
ArapValue probe_arap(JetView<const Scalar> jets, double bending, double weight, JetView<Scalar> cotangents) {
  const at::Tensor given = tensor_of(jets);
  const at::Tensor values =
      aten_arap(given, bending, weight, EnergyTables(given), tensor_of(cotangents)).to(at::kDouble);
  return {values[0].item<double>(), values[1].item<double>()};
}

template <class Scalar>
double probe_gauss(JetView<const Scalar> jets, ConstPointsRef<Scalar> normals,
                   const Eigen::Ref<const Eigen::VectorX<Scalar>>& sample_weights,
                   const GaussPreference& preference, double weight, JetView<Scalar> cotangents) {
  const at::Tensor given = tensor_of(jets);
  RowMatrix<double> rows(preference.normals.rows(), 4);
  rows << preference.normals, preference.weights;
  const at::Tensor weights = sample_weights.size() > 0
                                 ? matrix_of(sample_weights.data(), 1, sample_weights.size())[0]
                                 : at::Tensor();
  return aten_gauss(given, matrix_of(normals.data(), normals.rows(), 3), weights,
                    matrix_of(rows.data(), rows.rows(), 4).to(given.scalar_type()), preference.sharpness,
                    weight, EnergyTables(given), tensor_of(cotangents))
      .template item<double>();
}

template <class Scalar>
double probe_barrier(JetView<const Scalar> jets, double threshold, double weight,
                     JetView<Scalar> cotangents) {
  const at::Tensor given = tensor_of(jets);
  return aten_barrier(given, threshold, weight, EnergyTables(given), tensor_of(cotangents))
      .template item<double>();
}

template <class Scalar>
double probe_handles(JetView<const Scalar> jets, const HandleBatch<Scalar>& batch, double weight,
                     JetView<Scalar> cotangents) {
  return aten_handles(tensor_of(jets), matrix_of(batch.targets.data(), batch.targets.rows(), 3),
                      matrix_of(batch.weights.data(), 1, batch.weights.size())[0], weight,
                      tensor_of(cotangents))
      .template item<double>();
}

#define ARAPFIELDS_PROBES(Scalar)                                                                  \
  template ArapValue probe_arap<Scalar>(JetView<const Scalar>, double, double, JetView<Scalar>);   \
  template double probe_gauss<Scalar>(JetView<const Scalar>, ConstPointsRef<Scalar>,               \
                                      const Eigen::Ref<const Eigen::VectorX<Scalar>>&,             \
                                      const GaussPreference&, double, JetView<Scalar>);            \
  template double probe_barrier<Scalar>(JetView<const Scalar>, double, double, JetView<Scalar>);   \
  template double probe_handles<Scalar>(JetView<const Scalar>, const HandleBatch<Scalar>&, double, \
                                        JetView<Scalar>);
ARAPFIELDS_PROBES(float)
ARAPFIELDS_PROBES(double)

}  // namespace arapfields
