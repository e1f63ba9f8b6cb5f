// SPDX-License-Identifier: GPL-3.0-or-later
// The energies of this folder as compositions of libtorch's operations, for tensors outside main memory. For
// libtorch sources alone. Nothing is read back, so nothing waits for the
// device. `jets` and `cotangents` are (columns, n, 3), contiguous; weight times the cotangents is added to
// the latter unless they are undefined. Values are means as in arap.h, gauss.h, distortion.h, handles.h and
// stance.h, as tensors.
#pragma once

#include <ATen/core/Tensor.h>

namespace arapfields {

/// The constants that the compositions select and multiply by. Made once beside a tensor: each is a transfer.
struct EnergyTables {
  explicit EnergyTables(const at::Tensor& like);

  at::Tensor davenport;  ///< (9, 16): J to Horn's 4×4 matrix
  at::Tensor turn;    ///< (16): where a round of Jacobi rotations finds its matrix's entries in (c, s, −s, 0)
  at::Tensor orders;  ///< (4, 4): row i is 0…3 with i and 0 exchanged
  at::Tensor entries;                      ///< (12): of a quaternion, see `left` and `right`
  at::Tensor left, right;                  ///< (3, 4): signs of these; R = (left ∘ q)(right ∘ q)ᵀ
  at::Tensor axial;                        ///< (9, 3): M to axl(M); transposed, w to [w]×
  at::Tensor slices;                       ///< (9): second_column(j, k) at 3j + k
  at::Tensor pairs;                        ///< (6, 9): collects these
  at::Tensor identity, next_column, last;  ///< (3, 3); (3): columns of J after k, and after that
};

/// Closest rotations (n,3,3) of Jacobians (n,3,3), and K of each by eigenvectors (columns of axes) and
/// eigenvalues (n,3): rotation_pack.h by a fixed number of Jacobi sweeps.
struct AtenPolar {
  at::Tensor rotation, axes, sums;
};
AtenPolar aten_polar(const at::Tensor& jacobians, const EnergyTables& tables);

/// Factors (n) of single points, on their energy and on their bending; undefined: ones.
struct AtenFactors {
  at::Tensor weights, bending;
};

/// (4): stretch, bend, energy and the stretch's part of it; the bend is 0 where the jets have no second
/// derivatives.
at::Tensor aten_arap(const at::Tensor& jets, double bending, double weight, const EnergyTables& tables,
                     at::Tensor cotangents, const AtenFactors& factors = {});
/// Normals (n,3), weights (n) or undefined, the preference as rows (normal, weight) (k,4).
at::Tensor aten_gauss(const at::Tensor& jets, const at::Tensor& normals, const at::Tensor& sample_weights,
                      const at::Tensor& preferred, double sharpness, double weight,
                      const EnergyTables& tables, at::Tensor cotangents);
/// The same with unit targets (n,3) of the samples: gauss.h's target_energy.
at::Tensor aten_targets(const at::Tensor& jets, const at::Tensor& normals, const at::Tensor& sample_weights,
                        const at::Tensor& targets, double weight, const EnergyTables& tables,
                        at::Tensor cotangents);
at::Tensor aten_barrier(const at::Tensor& jets, double threshold, double weight, const EnergyTables& tables,
                        at::Tensor cotangents);
/// Targets (n,3) and weights (n) as in HandleBatch.
at::Tensor aten_handles(const at::Tensor& jets, const at::Tensor& targets, const at::Tensor& weights,
                        double weight, at::Tensor cotangents);
/// Rest points (n,3), the stance's upward direction (3) and ground weights (n); its scale belongs to the
/// weight.
at::Tensor aten_stance(const at::Tensor& jets, const at::Tensor& rest, const at::Tensor& up,
                       const at::Tensor& ground, double weight, at::Tensor cotangents);

}  // namespace arapfields
