// SPDX-License-Identifier: GPL-3.0-or-later
// Our arrays as tensors, and tensors as our arrays.
#pragma once

#include "core/jets.h"
#include "tensors/operations.h"

namespace arapfields {

/// Numbers in main memory as a contiguous tensor; not copied, so they must outlive it.
template <class Number>
Tensor tensor_view(const Number* data, SizeList sizes) {
  return view_memory(const_cast<Number*>(data), number_type<Number>, sizes);
}

/// The same of a matrix, (rows, columns), whatever its layout; of a vector (n).
template <class Matrix>
Tensor tensor_view(const Matrix& m) {
  using Number = std::remove_const_t<typename Matrix::Scalar>;
  auto* const data = const_cast<Number*>(m.data());
  if constexpr (Matrix::IsVectorAtCompileTime)
    return view_memory(data, number_type<Number>, {m.size()}, {m.innerStride()});
  else
    return view_memory(data, number_type<Number>, {m.rows(), m.cols()}, {m.rowStride(), m.colStride()});
}

/// Jets, or cotangents of jets, (columns, n, 3).
template <class Scalar>
Tensor tensor_view(const JetView<Scalar>& jets) {
  return tensor_view(jets.data, {columns(jets.order), jets.count, 3});
}

/// A copy of a tensor in main memory, of its type, on the device of `beside`; does not wait for the device.
Tensor upload(const Tensor& host, const Tensor& beside);

/// A contiguous copy, of any of the above, in the type and on the device of `like`.
inline Tensor tensor_like(const Tensor& view, const Tensor& like) {
  return upload(view.to(like.type()), like);
}
template <class Numbers>
Tensor tensor_like(const Numbers& numbers, const Tensor& like) {
  return tensor_like(tensor_view(numbers), like);
}

/// The numbers of any tensor on any device: in double precision, contiguous, in main memory; as (n,3); flat.
Tensor doubles_of(const Tensor& tensor);
Points points_of(const Tensor& points);
Vector vector_of(const Tensor& tensor);
VectorF floats_of(const Tensor& tensor);

}  // namespace arapfields
