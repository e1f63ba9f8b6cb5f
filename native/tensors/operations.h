// SPDX-License-Identifier: GPL-3.0-or-later
// What makes new tensors: element by element with broadcasting, by sums, by selection, by products.
#pragma once

#include <vector>

#include "tensors/tensor.h"

namespace arapfields {

Tensor empty(SizeList sizes, NumberType type);
Tensor zeros(SizeList sizes, NumberType type);
/// Of the type and on the device of `like`; without sizes, of its sizes too.
Tensor empty(SizeList sizes, const Tensor& like);
Tensor zeros(SizeList sizes, const Tensor& like);
Tensor ones(SizeList sizes, const Tensor& like);
Tensor empty_like(const Tensor& like);
Tensor zeros_like(const Tensor& like);
Tensor ones_like(const Tensor& like);
/// A tensor without dimensions, in main memory.
Tensor scalar(double value);
/// Numbers in main memory, `strides` apart (none: without gaps); not copied, so they must outlive it.
Tensor view_memory(void* data, NumberType type, SizeList sizes, SizeList strides = {});

Tensor operator+(const Tensor& a, const Tensor& b);
Tensor operator-(const Tensor& a, const Tensor& b);
Tensor operator*(const Tensor& a, const Tensor& b);
Tensor operator/(const Tensor& a, const Tensor& b);
Tensor operator+(const Tensor& a, double b);
Tensor operator*(const Tensor& a, double b);
Tensor operator/(const Tensor& a, double b);
Tensor operator/(double a, const Tensor& b);
inline Tensor operator+(double a, const Tensor& b) { return b + a; }
inline Tensor operator*(double a, const Tensor& b) { return b * a; }
Tensor operator-(const Tensor& a);
Tensor operator-(double a, const Tensor& b);
inline Tensor operator-(const Tensor& a, double b) { return a + -b; }
Tensor hypot(const Tensor& a, const Tensor& b);
Tensor copysign(const Tensor& magnitude, const Tensor& sign);

Tensor abs(const Tensor& a);
Tensor sign(const Tensor& a);
Tensor square(const Tensor& a);
Tensor sqrt(const Tensor& a);
Tensor rsqrt(const Tensor& a);  ///< 1/√a
Tensor reciprocal(const Tensor& a);
Tensor exp(const Tensor& a);
Tensor log1p(const Tensor& a);
Tensor sigmoid(const Tensor& a);
Tensor sin(const Tensor& a);
Tensor cos(const Tensor& a);
Tensor clamp_min(const Tensor& a, double least);
/// a where condition > 0, b elsewhere.
Tensor where_positive(const Tensor& condition, const Tensor& a, const Tensor& b);

Tensor sum(const Tensor& a);
Tensor sum(const Tensor& a, SizeList dimensions, bool keep = false);
Tensor mean(const Tensor& a);
Tensor max(const Tensor& a);
Tensor max(const Tensor& a, Index dimension);
Tensor argmax(const Tensor& a);  ///< along the last dimension
Tensor norm(const Tensor& a);
bool all_finite(const Tensor& a);

Tensor stack(const std::vector<Tensor>& tensors, Index dimension);
/// The entries `which` (int64) along a dimension.
Tensor index_select(const Tensor& a, Index dimension, const Tensor& which);
/// Of the vectors along the last dimension.
Tensor cross(const Tensor& a, const Tensor& b);

/// Matrix products. c = factor·a b + kept·c, in c's own memory.
Tensor product(const Tensor& a, const Tensor& b);
void multiply(const Tensor& c, const Tensor& a, const Tensor& b, double factor = 1.0, double kept = 0.0);
inline void add_multiplied(const Tensor& c, const Tensor& a, const Tensor& b) { multiply(c, a, b, 1.0, 1.0); }
/// Of each matrix of (n, rows, columns).
Tensor batch_product(const Tensor& a, const Tensor& b);
/// Lower Cholesky factor; undefined where the matrix is not positive definite.
Tensor cholesky_factor(const Tensor& a);
/// X of a X = b, or of X a = b with `right`, for a triangular matrix a.
enum class Side { left, right };
Tensor solve_triangular(const Tensor& a, const Tensor& b, bool upper, Side side);
/// X of L Lᵀ X = b.
Tensor solve_by_factor(const Tensor& lower, const Tensor& b);
/// a∘b into c's own memory.
void multiply_elements(const Tensor& c, const Tensor& a, const Tensor& b);

}  // namespace arapfields
