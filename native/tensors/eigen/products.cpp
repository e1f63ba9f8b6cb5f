// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <mutex>
#include <stdexcept>
#include <vector>

#include "tensors/eigen/array.h"
#include "tensors/eigen/product_kernel.h"

namespace arapfields {
namespace {

/// Rows that substitution and factors do without products.
constexpr Index panel = 32;

template <class Scalar>
Strided<Scalar> strided(const Tensor& m) {
  return {m.data<std::remove_const_t<Scalar>>(), m.stride(0), m.stride(1)};
}

/// use(Scalar()) for double, or for float, which holds bfloat16 too.
template <class Use>
void with_real(const Tensor& tensor, Use&& use) {
  if (tensor.is_double())
    use(double());
  else
    use(float());
}

/// A buffer for the kernel, one for each product at a time; it is kept for later products. It is not
/// thread_local: where threads end, MinGW frees such memory before it runs destructors (GCC's bug 83562).
template <class Scalar>
class ProductMemory {
 public:
  ProductMemory() {
    Kept& kept = all();
    // Not waited for: in a forked child nobody may be left to unlock it.
    if (const std::unique_lock lock(kept.mutex, std::try_to_lock); lock && !kept.free.empty()) {
      memory_ = kept.free.back();
      kept.free.pop_back();
    }
    if (!memory_.defined()) memory_ = empty({product_buffer}, number_type<Scalar>);
  }
  ~ProductMemory() {
    Kept& kept = all();
    if (const std::unique_lock lock(kept.mutex, std::try_to_lock); lock && kept.free.size() < most_kept)
      kept.free.push_back(memory_);
  }
  ProductMemory(const ProductMemory&) = delete;
  ProductMemory& operator=(const ProductMemory&) = delete;
  Scalar* data() const { return memory_.data<Scalar>(); }

 private:
  static constexpr std::size_t most_kept = 64;
  struct Kept {
    Kept() { free.reserve(most_kept); }
    std::mutex mutex;
    std::vector<Tensor> free;
  };
  static Kept& all() {
    static Kept& kept = *new Kept;  // for good: threads may outlive static objects
    return kept;
  }
  Tensor memory_;
};

void require_product(const Tensor& c, const Tensor& a, const Tensor& b) {
  if (a.dims() != 2 || b.dims() != 2 || c.size(0) != a.size(0) || a.size(1) != b.size(0) ||
      c.size(1) != b.size(1) || a.type() != b.type() || c.type() != a.type())
    throw std::invalid_argument("matrices that do not fit a product");
}

/// b becomes X of a X = b, a few rows at a time.
void substitute(const Tensor& a, const Tensor& b, bool upper) {
  const Index n = a.size(0);
  for (Index done = 0; done < n; done += panel) {
    const Index count = std::min(panel, n - done), first = upper ? n - done - count : done;
    const Tensor rows = b.narrow(0, first, count);
    const Index before = upper ? first + count : 0;
    if (done > 0)
      multiply(rows, a.narrow(0, first, count).narrow(1, before, done), b.narrow(0, before, done), -1.0, 1.0);
    with_real(b, [&](auto number) {
      using Scalar = decltype(number);
      const SubstitutionBlock<Scalar> block{
          strided<const Scalar>(a.narrow(0, first, count).narrow(1, first, count)), strided<Scalar>(rows),
          count, b.size(1), upper};
      ARAPFIELDS_DISPATCH(substitute_block(block));
    });
  }
}

/// Of a few rows, which become the factor; whether there is one.
template <class Scalar>
bool factorize_panel(const Tensor& a) {
  const Strided<Scalar> m = strided<Scalar>(a);
  const auto at = [&](Index i, Index j) -> Scalar& { return m.data[i * m.row + j * m.column]; };
  for (Index j = 0; j < a.size(0); ++j) {
    for (Index k = 0; k < j; ++k)
      for (Index i = j; i < a.size(0); ++i) at(i, j) -= at(i, k) * at(j, k);
    if (!(at(j, j) > 0)) return false;
    const Scalar pivot = std::sqrt(at(j, j));
    for (Index i = j; i < a.size(0); ++i) at(i, j) /= pivot;
    for (Index i = 0; i < j; ++i) at(i, j) = 0;
  }
  return true;
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
  if (kept != 0.0 && kept != 1.0) c *= kept;
  if (a.count() == 0 && kept == 0.0) c.set_zero();
  with_real(c, [&](auto number) {
    using Scalar = decltype(number);
    const ProductMemory<Scalar> memory;
    const ProductBlock<Scalar> block{strided<Scalar>(c),
                                     strided<const Scalar>(a),
                                     strided<const Scalar>(b),
                                     a.size(0),
                                     a.size(1),
                                     b.size(1),
                                     static_cast<Scalar>(factor),
                                     kept != 0.0,
                                     memory.data()};
    ARAPFIELDS_DISPATCH(multiply_block(block));
  });
  if (c.type() == NumberType::bfloat16) round_bfloat16(c);
}

Tensor product(const Tensor& a, const Tensor& b) {
  const Tensor c = empty({a.size(0), b.size(1)}, a);
  multiply(c, a, b);
  return c;
}

Tensor batch_product(const Tensor& a, const Tensor& b) {
  const Tensor c = empty({a.size(0), a.size(1), b.size(2)}, a);
  for (Index n = 0; n < c.size(0); ++n) multiply(c[n], a[n], b[n]);
  return c;
}

Tensor cholesky_factor(const Tensor& a) {
  Tensor factor = a.clone();
  const Index n = a.size(0);
  bool definite = true;
  for (Index k = 0; k < n && definite; k += panel) {
    const Index count = std::min(panel, n - k), below = n - k - count;
    const Tensor columns = factor.narrow(1, k, count), done = factor.narrow(1, 0, k),
                 own = columns.narrow(0, k, count);
    multiply(columns.narrow(0, k, n - k), done.narrow(0, k, n - k), done.narrow(0, k, count).t(), -1.0, 1.0);
    with_real(factor, [&](auto number) { definite = factorize_panel<decltype(number)>(own); });
    if (!definite) return {};
    const Tensor rest = columns.narrow(0, k + count, below);
    rest.assign(solve_triangular(own, rest.t(), /*upper=*/false, Side::left).t());
    columns.narrow(0, 0, k).set_zero();
  }
  return factor;
}

Tensor solve_triangular(const Tensor& a, const Tensor& b, bool upper, Side side) {
  if (side == Side::right) return solve_triangular(a.t(), b.t(), !upper, Side::left).t();
  const Tensor solution = b.clone();
  substitute(a, solution, upper);
  return solution;
}

Tensor solve_by_factor(const Tensor& lower, const Tensor& b) {
  const Tensor solution = b.clone();
  substitute(lower, solution, /*upper=*/false);
  substitute(lower.t(), solution, /*upper=*/true);
  return solution;
}

}  // namespace arapfields
