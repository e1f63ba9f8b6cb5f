// SPDX-License-Identifier: GPL-3.0-or-later
// The compositions of composed_energies.h on jets in main memory, with the kernels' signatures: for
// comparison.
#pragma once

#include "energies/arap.h"
#include "energies/gauss.h"
#include "energies/handles.h"
#include "energies/stance.h"

namespace arapfields {

template <class Scalar>
ARAPFIELDS_EXPORT_TO_TESTS ArapValue probe_arap(JetView<const Scalar> jets, double bending, double weight,
                                                JetView<Scalar> cotangents, ArapFactors<Scalar> factors);
template <class Scalar>
ARAPFIELDS_EXPORT_TO_TESTS double probe_gauss(JetView<const Scalar> jets, ConstPointsRef<Scalar> normals,
                                              const Eigen::Ref<const Eigen::VectorX<Scalar>>& sample_weights,
                                              const GaussPreference& preference, double weight,
                                              JetView<Scalar> cotangents);
template <class Scalar>
ARAPFIELDS_EXPORT_TO_TESTS double probe_targets(
    JetView<const Scalar> jets, ConstPointsRef<Scalar> normals, ConstPointsRef<Scalar> targets,
    const Eigen::Ref<const Eigen::VectorX<Scalar>>& sample_weights, double weight,
    JetView<Scalar> cotangents);
template <class Scalar>
ARAPFIELDS_EXPORT_TO_TESTS double probe_barrier(JetView<const Scalar> jets, double threshold, double weight,
                                                JetView<Scalar> cotangents);
template <class Scalar>
ARAPFIELDS_EXPORT_TO_TESTS double probe_handles(JetView<const Scalar> jets, const HandleBatch<Scalar>& batch,
                                                double weight, JetView<Scalar> cotangents);
template <class Scalar>
ARAPFIELDS_EXPORT_TO_TESTS double probe_stance(JetView<const Scalar> jets, ConstPointsRef<Scalar> rest,
                                               const Stance& stance, double weight,
                                               JetView<Scalar> cotangents);

}  // namespace arapfields
