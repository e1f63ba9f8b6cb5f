// SPDX-License-Identifier: GPL-3.0-or-later
// Eigen's decompositions and products, compiled once: each takes the compiler seconds.
#pragma once

#include <Eigen/QR>

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
Eigen::MatrixXd solve_definite(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right);

/// X of least norm among those of least ‖A X − B‖.
Eigen::MatrixXd least_squares(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

Eigen::MatrixXd product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);
Eigen::MatrixXd transposed_product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);  ///< Aᵀ B
Mat3 cross_moments(PointsIn a, PointsIn b);  ///< Σ aᵢ bᵢᵀ of the rows

/// Q R = A.
class OrthogonalFactor {
 public:
  OrthogonalFactor() = default;
  explicit OrthogonalFactor(const Eigen::MatrixXd& matrix);

  Eigen::MatrixXd times(const Eigen::MatrixXd& b) const;             ///< Q B
  Eigen::MatrixXd transposed_times(const Eigen::MatrixXd& b) const;  ///< Qᵀ B
  Eigen::MatrixXd upper() const;                                     ///< R

 private:
  Eigen::HouseholderQR<Eigen::MatrixXd> qr_;
};

}  // namespace arapfields
