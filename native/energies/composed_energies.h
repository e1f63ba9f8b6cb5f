// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "energies/arap.h"
#include "energies/gauss.h"
#include "energies/handles.h"
#include "energies/stance.h"
#include "tensors/tensor.h"

// The energies of this folder as compositions of tensor operations, for tensors on a GPU. Nothing is read
// back, so the host does not wait for the device. `jets` and `cotangents` are (columns, n, 3), contiguous;
// weight times the cotangents is added to the latter unless they are undefined. Values are means as in
// arap.h, gauss.h, distortion.h, handles.h and stance.h, as tensors.

namespace arapfields {

/// Constant index and coefficient tensors of the compositions, uploaded once to the device of `like`.
struct EnergyTables {
  explicit EnergyTables(const Tensor& like);

  Tensor davenport;    ///< (9, 16): J to Horn's 4×4 matrix
  Tensor turn;         ///< (16): indices of a Jacobi round's 4×4 matrix in (c, c', s, s', −s, −s', 0)
  Tensor diagonal;     ///< (4): flat indices in a 4×4 matrix of its diagonal,
  Tensor even;         ///< (2): of the entries (0,0) and (2,2) of a round's planes,
  Tensor odd;          ///< (2): of (1,1) and (3,3),
  Tensor pair;         ///< (2): of (0,1) and (2,3)
  Tensor exchange;     ///< (4, 4, 4): matrix i swaps columns i and 0
  Tensor entries;      ///< (12): indices of a quaternion's entries, see `left` and `right`
  Tensor left;         ///< (3, 4): their signs; R = (left ∘ q)(right ∘ q)ᵀ
  Tensor right;        ///< (3, 4)
  Tensor axial;        ///< (9, 3): M to axl(M); transposed, w to [w]×
  Tensor slices;       ///< (9): second_column(j, k) at 3j + k
  Tensor pairs;        ///< (6, 9): sums the entries of `slices` into the six second-derivative columns
  Tensor identity;     ///< (3, 3)
  Tensor next_column;  ///< (3): the jets' column of J's column k + 1 (mod 3),
  Tensor last;         ///< (3): and of k + 2
  Tensor next_axis;    ///< (3): k + 1 (mod 3)
  Tensor last_axis;    ///< (3): k + 2
};

/// A weighted part of a term (energies/term.h), on the device where it was computed.
struct ComposedPart {
  std::string name;
  Tensor value;
};

/// Closest rotations (n,3,3) of Jacobians (n,3,3), and K of each by eigenvectors (columns of axes) and
/// eigenvalues (n,3): rotation_pack.h by a fixed number of Jacobi sweeps.
struct ComposedPolar {
  Tensor rotation;
  Tensor axes;
  Tensor sums;
};
ComposedPolar composed_polar(const Tensor& jacobians, const EnergyTables& tables);

/// Factors (n) of single points, on their energy and on their bending; undefined: ones.
struct ComposedFactors {
  Tensor weights;
  Tensor bending;
};

/// (4): stretch, bend, energy and the stretch's part of it; the bend is 0 where the jets have no second
/// derivatives.
Tensor composed_arap(const Tensor& jets, double bending, double weight, const EnergyTables& tables,
                     Tensor cotangents, const ComposedFactors& factors = {});
/// Normals (n,3), weights (n) or undefined, the preference as rows (normal, weight) (k,4).
Tensor composed_gauss(const Tensor& jets, const Tensor& normals, const Tensor& sample_weights,
                      const Tensor& preferred, double sharpness, double weight, const EnergyTables& tables,
                      Tensor cotangents);
/// The same with unit targets (n,3) of the samples: gauss.h's target_energy.
Tensor composed_targets(const Tensor& jets, const Tensor& normals, const Tensor& sample_weights,
                        const Tensor& targets, double weight, const EnergyTables& tables, Tensor cotangents);
Tensor composed_barrier(const Tensor& jets, double threshold, double weight, const EnergyTables& tables,
                        Tensor cotangents);
/// Targets (n,3) and weights (n) as in HandleBatch.
Tensor composed_handles(const Tensor& jets, const Tensor& targets, const Tensor& weights, double weight,
                        Tensor cotangents);
/// Rest points (n,3), the stance's upward direction (3) and ground weights (n); its scale belongs to the
/// weight.
Tensor composed_stance(const Tensor& jets, const Tensor& rest, const Tensor& up, const Tensor& ground,
                       double weight, const EnergyTables& tables, Tensor cotangents);

// The compositions of composed_energies.h on jets in main memory, with the kernels' signatures: for
// comparison.

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
