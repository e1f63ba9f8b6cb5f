// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/task.h"
#include "fields/radial_basis.h"
#include "wrap/pull.h"

namespace arapfields {

/// What a velocity v is to be like at points (n,3) of a surface in motion.
struct WrapMotion {
  Points places;
  RowMatrix<double> jacobians;  ///< (n,9), row-major: of the motion from rest until now
  Vector rigid;                 ///< (n) weights of ‖∇v J − (R − J)‖², R the rotation closest to J
  Vector viscous;               ///< (n) weights of ‖∇v‖²
  double ridge = 0.0;           ///< weight of the squared coefficients
};

/// Landmarks (k,3), and the ways that they are asked to go, with the weight of their mean square.
struct WrapMarks {
  Points places, ways;
  double weight = 0.0;
};

/// The coefficients (basis.size(), 3) of the velocity that answers best to the forces, the landmarks and what
/// the surface resists, in the sense of weighted least squares: all of them at once, by a Cholesky factor.
RowMatrix<double> solve_velocity(const RadialBasis& basis, const WrapMotion& motion, const WrapForces& forces,
                                 const WrapMarks& marks, const Progress& progress);

}  // namespace arapfields
