// SPDX-License-Identifier: GPL-3.0-or-later
// Eigen's decompositions, compiled once: each takes the compiler seconds.
#pragma once

#include "core/types.h"

namespace arapfields {

/// Eigenvalues in ascending order, and unit eigenvectors as columns.
template <class Values, class Vectors>
struct SymmetricEigen {
  Values values;
  Vectors vectors;
};

/// Of a symmetric matrix, by iteration; the lower triangle is read.
SymmetricEigen<Vector, Eigen::MatrixXd> symmetric_eigen(const Eigen::MatrixXd& matrix);
SymmetricEigen<Vec3, Mat3> symmetric_eigen3(const Mat3& matrix);

/// x of A x = b, for a symmetric positive definite A.
Vec3 solve_definite(const Mat3& matrix, const Vec3& right);

}  // namespace arapfields
