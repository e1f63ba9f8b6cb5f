// SPDX-License-Identifier: GPL-3.0-or-later
// Our arrays and libtorch's tensors; for libtorch sources alone.
#pragma once

#include <ATen/ATen.h>

#include "core/jets.h"
#include "core/types.h"

namespace arapfields {

/// Numbers in main memory as a contiguous tensor; not copied, so they must outlive it.
template <class Scalar>
at::Tensor tensor_view(const Scalar* data, at::IntArrayRef sizes) {
  return at::from_blob(const_cast<Scalar*>(data), sizes, c10::CppTypeToScalarType<Scalar>::value);
}

/// The same of a matrix, (rows, columns), whatever its layout; of a vector (n).
template <class Matrix>
at::Tensor tensor_view(const Matrix& m) {
  using Scalar = std::remove_const_t<typename Matrix::Scalar>;
  const auto type = c10::CppTypeToScalarType<Scalar>::value;
  auto* const data = const_cast<Scalar*>(m.data());
  if constexpr (Matrix::IsVectorAtCompileTime)
    return at::from_blob(data, {m.size()}, {m.innerStride()}, type);
  else
    return at::from_blob(data, {m.rows(), m.cols()}, {m.rowStride(), m.colStride()}, type);
}

/// Jets, or cotangents of jets, (columns, n, 3).
template <class Scalar>
at::Tensor tensor_view(const JetView<Scalar>& jets) {
  return tensor_view(jets.data, {columns(jets.order), jets.count, 3});
}

/// A copy of a tensor in main memory, of its dtype, on the device of `beside`. Does not wait for the device:
/// the way there leads through page-locked memory.
at::Tensor upload(const at::Tensor& host, const at::Tensor& beside);

/// A contiguous copy, of any of the above, in the dtype and on the device of `like`.
inline at::Tensor tensor_like(const at::Tensor& view, const at::Tensor& like) {
  return upload(view.to(like.scalar_type()), like);
}
template <class Numbers>
at::Tensor tensor_like(const Numbers& numbers, const at::Tensor& like) {
  return tensor_like(tensor_view(numbers), like);
}

/// The numbers of any real tensor on any device: (n,3); flat.
Points points_of(const at::Tensor& points);
Vector vector_of(const at::Tensor& tensor);

}  // namespace arapfields
