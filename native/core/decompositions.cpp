// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/decompositions.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace arapfields {

SymmetricEigen<Vector, Eigen::MatrixXd> symmetric_eigen(const Eigen::MatrixXd& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

SymmetricEigen<Vec3, Mat3> symmetric_eigen3(const Mat3& matrix) {
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

Vec3 solve_definite(const Mat3& matrix, const Vec3& right) { return matrix.ldlt().solve(right); }

}  // namespace arapfields
