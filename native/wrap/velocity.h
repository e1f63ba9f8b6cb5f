// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/task.h"
#include "fields/radial_basis.h"
#include "wrap/correspondence.h"

namespace arapfields {

/// The stiffness terms of a moving surface: quadratic energies of its velocity v at n points.
struct MotionStiffness {
  Points points;                ///< (n,3) current positions
  RowMatrix<double> jacobians;  ///< (n,9), row-major: J of the motion since rest
  Vector rigidity;              ///< (n) weights of ‖∇v J − (R − J)‖², R the rotation closest to J
  Vector viscosity;             ///< (n) weights of ‖∇v‖²
  double ridge = 0.0;           ///< weight of the squared coefficients
  bool at_rest = false;         ///< points are those at rest and v is a change of the motion: ‖∇v − (R − J)‖²
};

/// Landmarks (k,3), their displacements onto their targets, and the weight of the mean squared difference.
struct LandmarkTerm {
  Points points, displacements;
  double weight = 0.0;
};

/// The velocity that minimises the sum of all terms: coefficients (basis.size(), 3) of a radial field. The
/// terms are quadratic, so one Cholesky factor of the normal equations solves them (docs/method.md, section
/// Wrap).
RowMatrix<double> solve_velocity(const RadialBasis& basis, const MotionStiffness& stiffness,
                                 const CorrespondenceTerms& correspondences, const LandmarkTerm& landmarks,
                                 const Progress& progress);

}  // namespace arapfields
