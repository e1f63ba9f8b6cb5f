// SPDX-License-Identifier: GPL-3.0-or-later
#include <stdexcept>

#include "tensors/eigen/array.h"
#include "tensors/eigen/product_kernel.h"

namespace arapfields {
namespace {

bool has_rows_or_columns(const Tensor& m) {
  return m.stride(1) == 1 || m.stride(0) == 1 || m.size(1) == 1;
}

/// The tensor (rows, columns) as it lies, which must have contiguous rows or columns.
template <class Scalar>
Strided<Scalar> strided(const Tensor& m) {
  Strided<Scalar> result;
  result.data = m.data<std::remove_const_t<Scalar>>();
  result.rows = m.size(0), result.columns = m.size(1);
  // What has but one column is by rows with any stride; a single row or column has no next one.
  result.by_rows = m.stride(1) == 1 || result.columns == 1;
  result.stride = result.by_rows ? m.stride(0) : m.stride(1);
  if (result.rows == 1 && (result.by_rows || result.columns == 1)) result.stride = result.columns;
  return result;
}

Tensor with_rows(const Tensor& m) { return has_rows_or_columns(m) ? m : m.contiguous(); }

/// Calls use(Scalar()) for float or double.
template <class Use>
void with_real(const Tensor& tensor, Use&& use) {
  if (tensor.is_double())
    use(double());
  else
    use(float());
}

void require_product(const Tensor& c, const Tensor& a, const Tensor& b) {
  if (a.dims() != 2 || b.dims() != 2 || c.size(0) != a.size(0) || a.size(1) != b.size(0) ||
      c.size(1) != b.size(1) || a.type() != b.type() || c.type() != a.type())
    throw std::invalid_argument("matrices that do not fit a product");
}

}  // namespace

void multiply(const Tensor& c, const Tensor& a, const Tensor& b, double factor, double kept) {
  require_product(c, a, b);
  if (c.count() == 0) return;
  if (c.stride(1) != 1 && c.size(1) > 1) {
    if (c.stride(0) == 1) return multiply(c.t(), b.t(), a.t(), factor, kept);
    const Tensor rows = c.clone();
    multiply(rows, a, b, factor, kept);
    c.assign(rows);
    return;
  }
  if (kept == 0.0)
    c.set_zero();
  else if (kept != 1.0)
    c *= kept;
  if (a.count() == 0) return;
  const Tensor left = with_rows(a), right = with_rows(b);
  with_real(c, [&](auto number) {
    using Scalar = decltype(number);
    ARAPFIELDS_DISPATCH(add_block_product(strided<Scalar>(c), strided<const Scalar>(left),
                                          strided<const Scalar>(right), static_cast<Scalar>(factor)));
  });
  if (c.type() == NumberType::bfloat16) round_bfloat16(c);
}

Tensor product(const Tensor& a, const Tensor& b) {
  const Tensor c = empty({a.size(0), b.size(1)}, a);
  multiply(c, a, b);
  return c;
}

Tensor batch_product(const Tensor& a, const Tensor& b) {
  const Tensor c = zeros({a.size(0), a.size(1), b.size(2)}, a);
  with_real(c, [&](auto number) {
    using Scalar = decltype(number);
    Scalar* out = c.data<Scalar>();
    for (Index n = 0; n < c.size(0); ++n)
      for (Index i = 0; i < c.size(1); ++i)
        for (Index j = 0; j < c.size(2); ++j, ++out)
          for (Index k = 0; k < a.size(2); ++k)
            *out += a.data<Scalar>()[n * a.stride(0) + i * a.stride(1) + k * a.stride(2)] *
                    b.data<Scalar>()[n * b.stride(0) + k * b.stride(1) + j * b.stride(2)];
  });
  return c;
}

Tensor cholesky_factor(const Tensor& a) {
  const Tensor factor = a.clone();
  bool definite = true;
  with_real(factor, [&](auto number) {
    definite = ARAPFIELDS_DISPATCH(factorize_block(strided<decltype(number)>(factor)));
  });
  return definite ? factor : Tensor();
}

Tensor solve_triangular(const Tensor& a, const Tensor& b, bool upper, Side side) {
  if (side == Side::right) return solve_triangular(a.t(), b.t(), !upper, Side::left).t();
  const Tensor factor = with_rows(a), solution = b.clone();
  with_real(solution, [&](auto number) {
    using Scalar = decltype(number);
    if (upper)
      ARAPFIELDS_DISPATCH(solve_upper_block(strided<const Scalar>(factor), strided<Scalar>(solution)));
    else
      ARAPFIELDS_DISPATCH(solve_lower_block(strided<const Scalar>(factor), strided<Scalar>(solution)));
  });
  return solution;
}

Tensor solve_by_factor(const Tensor& lower, const Tensor& b) {
  return solve_triangular(lower.t(), solve_triangular(lower, b, /*upper=*/false, Side::left), /*upper=*/true,
                          Side::left);
}

}  // namespace arapfields
