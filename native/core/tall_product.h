// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "core/types.h"

namespace arapfields {

/// A matrix for many products with three columns, which BLAS is slow at: rows are padded with zeros to full
/// vectors. With `lower`, only the lower triangle of a square matrix is stored and used.
template <class Scalar>
class TallMatrix {
 public:
  TallMatrix() = default;
  explicit TallMatrix(const RowMatrix<double>& matrix, bool lower = false);
  Index rows() const { return values_.rows(); }
  Index cols() const { return cols_; }
  /// A B for B (cols, 3).
  PointsOf<Scalar> times(ConstPointsRef<Scalar> b) const;
  /// Aᵀ B for B (rows, 3).
  PointsOf<Scalar> transpose_times(ConstPointsRef<Scalar> b) const;

 private:
  RowMatrix<Scalar> values_;
  Index cols_ = 0;
  bool lower_ = false;
};

}  // namespace arapfields
