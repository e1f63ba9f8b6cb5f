// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "core/task.h"
#include "core/types.h"

namespace arapfields {

/// Gaussian splats (Kerbl et al. 2023): anisotropic Gaussians with an opacity and a colour that depends on
/// the direction they are seen from. Coordinates are the scan's own.
struct ARAPFIELDS_EXPORT GaussianSplats {
  PointsF centers;             ///< (n,3)
  RowMatrix<float> rotations;  ///< (n,4) unit quaternions (w, x, y, z); columns of the rotation are the axes
  PointsF log_scales;          ///< (n,3) logarithms of the standard deviations along the axes
  VectorF opacity_logits;      ///< (n) log(a / (1 − a)) of the opacities a; infinite where a is 0 or 1
  RowMatrix<float> harmonics;  ///< (n, 3 k) colours of k = 1, 4, 9 or 16 real spherical harmonics
  std::string other_properties;  ///< declarations in a PLY file of what else each splat has
  RowMatrix<char> other_values;  ///< (n, bytes) of these

  Index size() const { return centers.rows(); }
  /// Copies of these splats.
  GaussianSplats copies(const std::vector<Index>& rows) const;
  /// Appends copies of these splats.
  void append_copies(const std::vector<Index>& rows);
  /// Becomes as many splats as these with their opacities and other values; the rest is not set.
  void be_places_of(const GaussianSplats& other);
  /// Throws InvalidInput that names what has another number of rows, or numbers that it cannot have.
  void validate() const;
};

/// R with the axes of a unit quaternion (w, x, y, z) as columns.
Mat3 axes_of(const Eigen::Ref<const Eigen::RowVector4f>& rotation);

/// Splats under an affine map x → A x + t: centers, covariances A Σ Aᵀ, and colours turned by the rotation
/// closest to A. Throws InvalidInput that names `matrix` where its last row is not (0, 0, 0, 1) or det A is
/// not above 0, as for splats that do not fit together, and Cancelled.
ARAPFIELDS_EXPORT GaussianSplats transform_splats(const GaussianSplats& splats, const Mat4& matrix,
                                                  const Progress& progress = {});

}  // namespace arapfields
