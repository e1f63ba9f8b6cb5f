// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/decompositions.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>

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

Eigen::MatrixXd solve_definite(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right) {
  return matrix.ldlt().solve(right);
}

Eigen::MatrixXd least_squares(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return a.completeOrthogonalDecomposition().solve(b);
}

Eigen::MatrixXd product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) { return a * b; }

Eigen::MatrixXd transposed_product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return a.transpose() * b;
}

Mat3 cross_moments(PointsIn a, PointsIn b) { return a.transpose() * b; }

OrthogonalFactor::OrthogonalFactor(const Eigen::MatrixXd& matrix) : qr_(matrix) {}

Eigen::MatrixXd OrthogonalFactor::times(const Eigen::MatrixXd& b) const { return qr_.householderQ() * b; }

Eigen::MatrixXd OrthogonalFactor::transposed_times(const Eigen::MatrixXd& b) const {
  return qr_.householderQ().adjoint() * b;
}

Eigen::MatrixXd OrthogonalFactor::upper() const {
  return qr_.matrixQR().topRows(std::min(qr_.rows(), qr_.cols())).triangularView<Eigen::Upper>();
}

}  // namespace arapfields
