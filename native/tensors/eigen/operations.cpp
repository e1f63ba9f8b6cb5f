// SPDX-License-Identifier: GPL-3.0-or-later
#include "tensors/operations.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "tensors/eigen/array.h"

namespace arapfields {
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
