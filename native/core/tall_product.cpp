// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/tall_product.h"

#include "core/errors.h"
#include "core/parallel.h"
#include "core/tall_product_kernel.h"

namespace arapfields {
namespace {

constexpr Index padding = 64;       // a strip of tall_product_strip
constexpr Index grain = 64 * 1024;  // entries worth a thread

}  // namespace

template <class Scalar>
TallMatrix<Scalar>::TallMatrix(const RowMatrix<double>& matrix, bool lower)
    : cols_(matrix.cols()), lower_(lower) {
  values_ = RowMatrix<Scalar>::Zero(matrix.rows(), (cols_ + padding - 1) / padding * padding);
  for (Index i = 0; i < matrix.rows(); ++i) {
    const Index kept = lower ? std::min(i + 1, cols_) : cols_;
    values_.row(i).head(kept) = matrix.row(i).head(kept).template cast<Scalar>();
  }
}

template <class Scalar>
PointsOf<Scalar> TallMatrix<Scalar>::times(ConstPointsRef<Scalar> b) const {
  require(b.rows() == cols_, "b", std::to_string(b.rows()) + " rows", std::to_string(cols_) + " are needed");
  RowMatrix<Scalar> columns = RowMatrix<Scalar>::Zero(3, values_.cols());
  columns.leftCols(cols_) = b.transpose();
  PointsOf<Scalar> result(rows(), 3);
  parallel_for(0, rows(), std::max<Index>(1, grain / std::max<Index>(1, values_.cols())),
               [&](Index begin, Index end) {
                 const TallBlock<Scalar> block{values_.data(), values_.cols(), lower_};
                 ARAPFIELDS_DISPATCH(tall_product_rows(block, begin, end, columns.data(), result.data()));
               });
  return result;
}

template <class Scalar>
PointsOf<Scalar> TallMatrix<Scalar>::transpose_times(ConstPointsRef<Scalar> b) const {
  require(b.rows() == rows(), "b", std::to_string(b.rows()) + " rows",
          std::to_string(rows()) + " are needed");
  RowMatrix<Scalar> columns(3, values_.cols());
  parallel_for(
      0, values_.cols() / padding, std::max<Index>(1, grain / padding / std::max<Index>(1, rows())),
      [&](Index begin, Index end) {
        const TallBlock<Scalar> block{values_.data(), values_.cols(), lower_};
        for (Index strip = begin; strip < end; ++strip)
          ARAPFIELDS_DISPATCH(tall_product_strip(block, strip * padding, rows(), b.data(), columns.data()));
      });
  return columns.leftCols(cols_).transpose();
}

template class TallMatrix<float>;
template class TallMatrix<double>;

}  // namespace arapfields
