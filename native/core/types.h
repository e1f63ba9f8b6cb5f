// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "core/export.h"

// Part of the binary interface: it decides how matrices are laid out, and who may free them.
static_assert(EIGEN_MAX_ALIGN_BYTES == 16, "define EIGEN_MAX_ALIGN_BYTES=16, as the CMake package does");

namespace arapfields {

using Index = std::int64_t;

/// (n,3), one point a row, contiguous rows: the memory layout of a C-ordered NumPy array.
template <class Scalar>
using PointsOf = Eigen::Matrix<Scalar, Eigen::Dynamic, 3, Eigen::RowMajor>;
using Points = PointsOf<double>;
using PointsF = PointsOf<float>;
/// (m,3) vertex indices, counter-clockwise seen from outside.
using Triangles = Eigen::Matrix<std::int32_t, Eigen::Dynamic, 3, Eigen::RowMajor>;

template <class Scalar>
using ConstPointsRef = const Eigen::Ref<const PointsOf<Scalar>>&;
using PointsIn = ConstPointsRef<double>;
using TrianglesIn = const Eigen::Ref<const Triangles>&;

using Vector = Eigen::VectorXd;
using VectorF = Eigen::VectorXf;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Mat4 = Eigen::Matrix4d;
/// Dense row-major matrix, the layout that gemm (tensors/dense.h) expects.
template <class Scalar>
using RowMatrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Rows (n,3) of unit length; zeros stay.
template <class Rows>
Points unit_rows(const Eigen::MatrixBase<Rows>& rows) {
  Points result = rows.rowwise().normalized();
  for (Index i = 0; i < rows.rows(); ++i)
    if (rows.row(i).isZero(0.0)) result.row(i).setZero();
  return result;
}

}  // namespace arapfields
