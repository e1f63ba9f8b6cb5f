// SPDX-License-Identifier: GPL-3.0-or-later
#include "tensors/operations.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
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

namespace {

template <class F>
Tensor unary(const Tensor& a, const F& f) {
  const Tensor result = empty_like(a);
  with_type(a.type(), [&](auto number) { apply<decltype(number)>(result.array(), f, a.array()); });
  return result;
}

/// Numbers of two types become double precision.
template <class F>
Tensor binary(const Tensor& a, const Tensor& b, const F& f) {
  if (a.type() != b.type()) return binary(a.to(NumberType::float64), b.to(NumberType::float64), f);
  const Tensor result = make_broadcast(a, b, a.type());
  with_type(a.type(), [&](auto number) { apply<decltype(number)>(result.array(), f, a.array(), b.array()); });
  return result;
}

/// f(sum so far, next number), from `start`, over the chosen dimensions, in double precision.
template <class F>
Tensor reduce(const Tensor& a, SizeList dimensions, bool keep, double start, const F& f) {
  Extents kept = a.array().sizes, rest{};
  std::array<bool, most_dims> gone{};
  for (const Index d : dimensions) gone[as_size(wrapped(a, d))] = true;
  int dims = 0;
  for (std::size_t d = 0; d < as_size(a.dims()); ++d) {
    if (gone[d]) kept[d] = 1;
    if (!gone[d] || keep) rest[as_size(dims++)] = kept[d];
  }
  const Tensor sums = make_tensor(kept.data(), static_cast<int>(a.dims()), NumberType::float64);
  sums.fill(start);
  double* const out = sums.data<double>();
  with_type(a.type(), [&](auto number) {
    const auto* in = a.data<decltype(number)>();
    for_rows<2>(a.array(), {a.array().strides, strides_in(sums.array(), a.array())},
                [&](const auto& offsets, Index length, const auto& steps) {
                  const auto* row = in + offsets[0];
                  double* const to = out + offsets[1];
                  if (steps[1] == 0) {
                    double value = *to;
                    for (Index i = 0; i < length; ++i)
                      value = f(value, static_cast<double>(row[i * steps[0]]));
                    *to = value;
                  } else {
                    for (Index i = 0; i < length; ++i)
                      to[i * steps[1]] = f(to[i * steps[1]], static_cast<double>(row[i * steps[0]]));
                  }
                });
  });
  const Tensor result = make_tensor(rest.data(), dims, a.type());
  result.assign(sums.view_like(result));
  return result;
}

Tensor filled(Tensor tensor, double value) { return tensor.fill(value); }

double larger(double a, double b) { return a > b || std::isnan(a) ? a : b; }
constexpr double lowest = -std::numeric_limits<double>::infinity();

}  // namespace

Tensor make_broadcast(const Tensor& a, const Tensor& b, NumberType type) {
  const auto dims = static_cast<int>(std::max(a.dims(), b.dims()));
  Extents sizes{};
  for (int d = 0; d < dims; ++d) {
    const Index of_a = d - (dims - a.dims()), of_b = d - (dims - b.dims());
    const Index size_a = of_a < 0 ? 1 : a.size(of_a), size_b = of_b < 0 ? 1 : b.size(of_b);
    sizes[as_size(d)] = size_a == 1 ? size_b : size_a;
  }
  return make_tensor(sizes.data(), dims, type);
}

Tensor empty(SizeList sizes, NumberType type) {
  return make_tensor(sizes.begin(), static_cast<int>(sizes.size()), type);
}
Tensor zeros(SizeList sizes, NumberType type) { return filled(empty(sizes, type), 0.0); }
Tensor empty(SizeList sizes, const Tensor& like) { return empty(sizes, like.type()); }
Tensor zeros(SizeList sizes, const Tensor& like) { return zeros(sizes, like.type()); }
Tensor ones(SizeList sizes, const Tensor& like) { return filled(empty(sizes, like), 1.0); }
Tensor empty_like(const Tensor& like) {
  return make_tensor(like.array().sizes.data(), like.array().dims, like.type());
}
Tensor zeros_like(const Tensor& like) { return filled(empty_like(like), 0.0); }
Tensor ones_like(const Tensor& like) { return filled(empty_like(like), 1.0); }
Tensor scalar(double value) { return filled(empty({}, NumberType::float64), value); }

Tensor view_memory(void* data, NumberType type, SizeList sizes, SizeList strides) {
  auto array = std::make_shared<Tensor::Array>();
  array->data = static_cast<char*>(data);
  array->type = type;
  array->dims = static_cast<int>(sizes.size());
  std::copy(sizes.begin(), sizes.end(), array->sizes.begin());
  std::copy(strides.begin(), strides.end(), array->strides.begin());
  Index product = 1;
  for (std::size_t d = sizes.size(); d-- > 0 && strides.size() == 0; product *= sizes.begin()[d])
    array->strides[d] = product;
  return Tensor(std::move(array));
}

Tensor operator+(const Tensor& a, const Tensor& b) {
  return binary(a, b, [](auto x, auto y) { return x + y; });
}
Tensor operator-(const Tensor& a, const Tensor& b) {
  return binary(a, b, [](auto x, auto y) { return x - y; });
}
Tensor operator*(const Tensor& a, const Tensor& b) {
  return binary(a, b, [](auto x, auto y) { return x * y; });
}
Tensor operator/(const Tensor& a, const Tensor& b) {
  return binary(a, b, [](auto x, auto y) { return x / y; });
}
Tensor operator+(const Tensor& a, double b) {
  return unary(a, [b](auto x) { return x + static_cast<decltype(x)>(b); });
}
Tensor operator*(const Tensor& a, double b) {
  return unary(a, [b](auto x) { return x * static_cast<decltype(x)>(b); });
}
Tensor operator/(const Tensor& a, double b) {
  return unary(a, [b](auto x) { return x / static_cast<decltype(x)>(b); });
}
Tensor operator/(double a, const Tensor& b) {
  return unary(b, [a](auto x) { return static_cast<decltype(x)>(a) / x; });
}
Tensor operator-(const Tensor& a) {
  return unary(a, [](auto x) { return -x; });
}
Tensor operator-(double a, const Tensor& b) {
  return unary(b, [a](auto x) { return static_cast<decltype(x)>(a) - x; });
}

#define ARAPFIELDS_UNARY(name, expression)                                        \
  Tensor name(const Tensor& a) {                                                  \
    return unary(a, [](auto x) { return static_cast<decltype(x)>(expression); }); \
  }
ARAPFIELDS_UNARY(abs, x < 0 ? -x : x)
ARAPFIELDS_UNARY(sign, (x > 0) - (x < 0))
ARAPFIELDS_UNARY(square, x* x)
ARAPFIELDS_UNARY(sqrt, std::sqrt(x))
ARAPFIELDS_UNARY(rsqrt, 1 / std::sqrt(x))
ARAPFIELDS_UNARY(reciprocal, 1 / x)
ARAPFIELDS_UNARY(exp, std::exp(x))
ARAPFIELDS_UNARY(log1p, std::log1p(x))
ARAPFIELDS_UNARY(sigmoid, 1 / (1 + std::exp(-x)))
ARAPFIELDS_UNARY(sin, std::sin(x))
ARAPFIELDS_UNARY(cos, std::cos(x))

Tensor hypot(const Tensor& a, const Tensor& b) {
  return binary(a, b, [](auto x, auto y) { return static_cast<decltype(x)>(std::hypot(x, y)); });
}
Tensor copysign(const Tensor& magnitude, const Tensor& sign) {
  return binary(magnitude, sign,
                [](auto x, auto y) { return static_cast<decltype(x)>(std::copysign(x, y)); });
}
Tensor clamp_min(const Tensor& a, double least) {
  return unary(a, [least](auto x) {
    return x < static_cast<decltype(x)>(least) ? static_cast<decltype(x)>(least) : x;
  });
}
Tensor where_positive(const Tensor& condition, const Tensor& a, const Tensor& b) {
  const Tensor result = make_broadcast(make_broadcast(a, b, a.type()), condition, a.type());
  with_type(a.type(), [&](auto number) {
    apply<decltype(number)>(
        result.array(), [](auto c, auto x, auto y) { return c > 0 ? x : y; }, condition.array(), a.array(),
        b.array());
  });
  return result;
}

Tensor sum(const Tensor& a) { return sum(a.reshape({-1}), {0}); }
Tensor sum(const Tensor& a, SizeList dimensions, bool keep) {
  return reduce(a, dimensions, keep, 0.0, [](double x, double y) { return x + y; });
}
Tensor mean(const Tensor& a) { return sum(a) / static_cast<double>(a.count()); }
Tensor max(const Tensor& a) { return max(a.reshape({-1}), 0); }
Tensor max(const Tensor& a, Index dimension) { return reduce(a, {dimension}, false, lowest, larger); }
Tensor norm(const Tensor& a) { return sqrt(sum(square(a))); }
bool all_finite(const Tensor& a) {
  // A product with 0 is NaN for what is infinite.
  return sum(a * 0.0).number() == 0.0;
}

Tensor argmax(const Tensor& a) {
  const Tensor rows = a.contiguous();
  const Index length = rows.size(-1);
  const Tensor largest =
      make_tensor(rows.array().sizes.data(), static_cast<int>(a.dims()) - 1, NumberType::int64);
  with_type(a.type(), [&](auto number) {
    const auto* row = rows.data<decltype(number)>();
    for (Index i = 0; i < largest.count(); ++i, row += length)
      largest.data<Index>()[i] = std::max_element(row, row + length) - row;
  });
  return largest;
}

Tensor stack(const std::vector<Tensor>& tensors, Index dimension) {
  const Tensor first = tensors.front().unsqueeze(dimension);
  Extents sizes = first.array().sizes;
  const Index d = dimension < 0 ? dimension + first.dims() : dimension;
  sizes[as_size(d)] = static_cast<Index>(tensors.size());
  const Tensor result = make_tensor(sizes.data(), static_cast<int>(first.dims()), first.type());
  for (std::size_t i = 0; i < tensors.size(); ++i) result.select(d, static_cast<Index>(i)).assign(tensors[i]);
  return result;
}

Tensor index_select(const Tensor& a, Index dimension, const Tensor& which) {
  const Tensor from = a.contiguous();
  const Index d = wrapped(a, dimension), inner = from.stride(d) * number_bytes(a.type());
  Extents sizes = a.array().sizes;
  sizes[as_size(d)] = which.count();
  const Tensor result = make_tensor(sizes.data(), static_cast<int>(a.dims()), a.type());
  const Tensor rows = which.contiguous();
  const char* source = from.data<char>();
  char* to = result.data<char>();
  const Index outer = result.count() == 0 ? 0 : result.count() / (which.count() * from.stride(d));
  for (Index o = 0; o < outer; ++o, source += a.size(d) * inner)
    for (Index i = 0; i < which.count(); ++i, to += inner)
      std::memcpy(to, source + rows.data<Index>()[i] * inner, as_size(inner));
  return result;
}

Tensor cross(const Tensor& a, const Tensor& b) {
  const Tensor result = make_broadcast(a, b, a.type());
  for (Index k = 0; k < 3; ++k) {
    const Index i = (k + 1) % 3, j = (k + 2) % 3;
    result.select(-1, k).assign(a.select(-1, i) * b.select(-1, j) - a.select(-1, j) * b.select(-1, i));
  }
  return result;
}

void multiply_elements(const Tensor& c, const Tensor& a, const Tensor& b) {
  with_type(c.type(), [&](auto number) {
    apply<decltype(number)>(c.array(), [](auto x, auto y) { return x * y; }, a.array(), b.array());
  });
}

}  // namespace arapfields
