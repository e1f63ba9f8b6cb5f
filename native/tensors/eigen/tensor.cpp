// SPDX-License-Identifier: GPL-3.0-or-later
#include "tensors/tensor.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <new>
#include <stdexcept>

#include "tensors/eigen/array.h"

namespace arapfields {
namespace {

/// The same numbers under other sizes and strides.
Tensor make_view(const Tensor::Array& of, const Extents& sizes, const Extents& strides, int dims,
                 Index offset = 0) {
  auto view = std::make_shared<Tensor::Array>(of);
  view->data += offset * number_bytes(of.type);
  view->dims = dims;
  view->sizes = sizes;
  view->strides = strides;
  return Tensor(std::move(view));
}

template <class To, class From>
void copy_numbers(const Tensor::Array& to, const Tensor::Array& from) {
  To* const out = to.numbers<To>();
  const From* const in = from.numbers<From>();
  for_rows<2>(to, {to.strides, strides_in(from, to)},
              [&](const auto& offsets, Index length, const auto& steps) {
                To* const row = out + offsets[0];
                const From* const source = in + offsets[1];
                if (steps[0] == 1 && steps[1] == 1)
                  std::copy(source, source + length, row);
                else
                  for (Index i = 0; i < length; ++i)
                    row[i * steps[0]] = static_cast<To>(source[i * steps[1]]);
              });
}

/// self = f(self, other) for the numbers of self.
template <class F>
const Tensor& update(const Tensor& self, const Tensor& other, const F& f) {
  const Tensor same = other.to(self.type());
  with_type(self.type(),
            [&](auto number) { apply<decltype(number)>(self.array(), f, self.array(), same.array()); });
  return self;
}

template <class F>
const Tensor& update(const Tensor& self, const F& f) {
  with_type(self.type(), [&](auto number) { apply<decltype(number)>(self.array(), f, self.array()); });
  return self;
}

template <class F>
const Tensor& update(const Tensor& self, const Tensor& a, const Tensor& b, const F& f) {
  with_type(self.type(), [&](auto number) {
    apply<decltype(number)>(self.array(), f, self.array(), a.array(), b.array());
  });
  return self;
}

}  // namespace

Index wrapped(const Tensor& tensor, Index dimension) {
  return dimension < 0 ? dimension + tensor.dims() : dimension;
}

Tensor make_tensor(const Index* sizes, int dims, NumberType type) {
  constexpr std::align_val_t alignment{64};
  auto array = std::make_shared<Tensor::Array>();
  Index count = 1;
  for (int d = dims - 1; d >= 0; --d) {
    array->sizes[as_size(d)] = sizes[d];
    array->strides[as_size(d)] = count;
    count *= sizes[d];
  }
  array->type = type;
  array->dims = dims;
  const std::size_t bytes = as_size(std::max<Index>(1, count * number_bytes(type)));
  array->owner = std::shared_ptr<void>(::operator new(bytes, alignment),
                                       [](void* memory) { ::operator delete(memory, alignment); });
  array->data = static_cast<char*>(array->owner.get());
  return Tensor(std::move(array));
}

Extents strides_in(const Tensor::Array& a, const Tensor::Array& sizes) {
  Extents strides{};
  for (int d = sizes.dims - a.dims, i = 0; i < a.dims; ++d, ++i) {
    if (d < 0 || (a.sizes[as_size(i)] != 1 && a.sizes[as_size(i)] != sizes.sizes[as_size(d)]))
      throw std::invalid_argument("tensors whose sizes do not broadcast");
    strides[as_size(d)] = a.sizes[as_size(i)] == 1 ? 0 : a.strides[as_size(i)];
  }
  return strides;
}

void round_bfloat16(const Tensor& tensor) {
  update(tensor, [](auto x) {
    const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(x));
    const std::uint32_t even = bits + 0x7fffu + (bits >> 16 & 1u);
    return static_cast<decltype(x)>(std::bit_cast<float>(even & 0xffff0000u));
  });
}

NumberType Tensor::type() const { return array_->type; }
bool Tensor::on_host() const { return true; }
bool Tensor::is_contiguous() const {
  Index expected = 1;
  for (int d = array_->dims - 1; d >= 0; --d) {
    if (array_->sizes[as_size(d)] != 1 && array_->strides[as_size(d)] != expected) return count() == 0;
    expected *= array_->sizes[as_size(d)];
  }
  return true;
}
Index Tensor::dims() const { return array_->dims; }
Index Tensor::size(Index dimension) const { return array_->sizes[as_size(wrapped(*this, dimension))]; }
Index Tensor::stride(Index dimension) const { return array_->strides[as_size(wrapped(*this, dimension))]; }
Index Tensor::count() const {
  Index count = 1;
  for (int d = 0; d < array_->dims; ++d) count *= array_->sizes[as_size(d)];
  return count;
}
void* Tensor::raw() const { return array_->data; }
double Tensor::number() const {
  double value = 0.0;
  with_type(type(), [&](auto number) { value = static_cast<double>(*data<decltype(number)>()); });
  return value;
}

Tensor Tensor::narrow(Index dimension, Index begin, Index length) const {
  const std::size_t d = as_size(wrapped(*this, dimension));
  if (begin < 0 || length < 0 || begin + length > array_->sizes[d])
    throw std::invalid_argument("a range beyond a tensor's size");
  Extents sizes = array_->sizes;
  sizes[d] = length;
  return make_view(*array_, sizes, array_->strides, array_->dims, begin * array_->strides[d]);
}

Tensor Tensor::select(Index dimension, Index i) const {
  const std::size_t d = as_size(wrapped(*this, dimension));
  if (i < 0 || i >= array_->sizes[d]) throw std::invalid_argument("an index beyond a tensor's size");
  Extents sizes = array_->sizes, strides = array_->strides;
  std::copy(sizes.begin() + d + 1, sizes.end(), sizes.begin() + d);
  std::copy(strides.begin() + d + 1, strides.end(), strides.begin() + d);
  return make_view(*array_, sizes, strides, array_->dims - 1, i * array_->strides[d]);
}

Tensor Tensor::transpose(Index a, Index b) const {
  Extents sizes = array_->sizes, strides = array_->strides;
  const std::size_t i = as_size(wrapped(*this, a)), j = as_size(wrapped(*this, b));
  std::swap(sizes[i], sizes[j]);
  std::swap(strides[i], strides[j]);
  return make_view(*array_, sizes, strides, array_->dims);
}

Tensor Tensor::permute(SizeList order) const {
  Extents sizes{}, strides{};
  for (std::size_t d = 0; d < order.size(); ++d) {
    sizes[d] = array_->sizes[as_size(order.begin()[d])];
    strides[d] = array_->strides[as_size(order.begin()[d])];
  }
  return make_view(*array_, sizes, strides, array_->dims);
}

Tensor Tensor::unsqueeze(Index dimension) const {
  const std::size_t d = as_size(dimension < 0 ? dimension + dims() + 1 : dimension);
  Extents sizes = array_->sizes, strides = array_->strides;
  std::copy_backward(sizes.begin() + d, sizes.end() - 1, sizes.end());
  std::copy_backward(strides.begin() + d, strides.end() - 1, strides.end());
  sizes[d] = 1;
  strides[d] = 0;
  return make_view(*array_, sizes, strides, array_->dims + 1);
}

Tensor Tensor::expand(SizeList sizes) const {
  Array wanted;
  wanted.dims = static_cast<int>(sizes.size());
  std::copy(sizes.begin(), sizes.end(), wanted.sizes.begin());
  return make_view(*array_, wanted.sizes, strides_in(*array_, wanted), wanted.dims);
}

Tensor Tensor::view(SizeList sizes) const {
  Extents wanted{}, strides{};
  std::copy(sizes.begin(), sizes.end(), wanted.begin());
  Index known = 1;
  for (const Index size : sizes) known *= size < 0 ? 1 : size;
  for (std::size_t d = 0; d < sizes.size(); ++d)
    if (wanted[d] < 0) wanted[d] = known == 0 ? 0 : count() / known;
  Index product = 1;
  for (std::size_t d = sizes.size(); d-- > 0; product *= wanted[d]) strides[d] = product;
  if (!is_contiguous() || product != count())
    throw std::invalid_argument("a view that does not fit the tensor");
  return make_view(*array_, wanted, strides, static_cast<int>(sizes.size()));
}

Tensor Tensor::view_like(const Tensor& other) const {
  if (!is_contiguous() || other.count() != count())
    throw std::invalid_argument("a view that does not fit the tensor");
  const Array& to = other.array();
  Extents strides{};
  Index product = 1;
  for (int d = to.dims - 1; d >= 0; product *= to.sizes[as_size(d--)]) strides[as_size(d)] = product;
  return make_view(*array_, to.sizes, strides, to.dims);
}

Tensor Tensor::clone() const {
  Tensor result = make_tensor(array_->sizes.data(), array_->dims, type());
  result.assign(*this);
  return result;
}

Tensor Tensor::to(NumberType wanted) const {
  if (wanted == type()) return *this;
  Tensor result = make_tensor(array_->sizes.data(), array_->dims, wanted);
  result.assign(*this);
  return result;
}

Tensor Tensor::to_host() const { return *this; }
Tensor Tensor::to_device_of(const Tensor&) const { return *this; }
Tensor Tensor::to_device(const std::string&) const { return *this; }

const Tensor& Tensor::assign(const Tensor& from) const {
  with_type(type(), [&](auto to) {
    with_type(from.type(),
              [&](auto source) { copy_numbers<decltype(to), decltype(source)>(*array_, from.array()); });
  });
  if (type() == NumberType::bfloat16) round_bfloat16(*this);
  return *this;
}

const Tensor& Tensor::fill(double value) const {
  return update(*this, [value](auto x) { return static_cast<decltype(x)>(value); });
}
const Tensor& Tensor::add(const Tensor& other, double factor) const {
  if (factor == 1.0) return update(*this, other, [](auto x, auto y) { return x + y; });
  return update(*this, other, [factor](auto x, auto y) { return x + static_cast<decltype(x)>(factor) * y; });
}
const Tensor& Tensor::operator+=(double number) const {
  return update(*this, [number](auto x) { return x + static_cast<decltype(x)>(number); });
}
const Tensor& Tensor::operator*=(const Tensor& other) const {
  return update(*this, other, [](auto x, auto y) { return x * y; });
}
const Tensor& Tensor::operator*=(double number) const {
  return update(*this, [number](auto x) { return x * static_cast<decltype(x)>(number); });
}
const Tensor& Tensor::operator/=(const Tensor& other) const {
  return update(*this, other, [](auto x, auto y) { return x / y; });
}
const Tensor& Tensor::operator/=(double number) const {
  return update(*this, [number](auto x) { return x / static_cast<decltype(x)>(number); });
}
const Tensor& Tensor::add_product(const Tensor& a, const Tensor& b, double factor) const {
  return update(*this, a, b,
                [factor](auto x, auto y, auto z) { return x + static_cast<decltype(x)>(factor) * y * z; });
}
const Tensor& Tensor::add_quotient(const Tensor& a, const Tensor& b, double factor) const {
  return update(*this, a, b,
                [factor](auto x, auto y, auto z) { return x + static_cast<decltype(x)>(factor) * y / z; });
}

bool alike(const Tensor& a, const Tensor& b) { return a.type() == b.type(); }
bool same_sizes(const Tensor& a, const Tensor& b) {
  return a.dims() == b.dims() &&
         std::equal(a.array().sizes.begin(), a.array().sizes.begin() + a.dims(), b.array().sizes.begin());
}
bool is_same(const Tensor& a, const Tensor& b) {
  return a.data<char>() == b.data<char>() && same_sizes(a, b) && a.array().strides == b.array().strides;
}

}  // namespace arapfields
