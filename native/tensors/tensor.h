// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <initializer_list>
#include <memory>
#include <string>

#include "core/types.h"

namespace arapfields {

enum class NumberType : signed char { float32, float64, int64, bfloat16 };

template <class Number>
inline constexpr NumberType number_type = NumberType::float32;
template <>
inline constexpr NumberType number_type<double> = NumberType::float64;
template <>
inline constexpr NumberType number_type<Index> = NumberType::int64;

using SizeList = std::initializer_list<Index>;

/// A dense array of up to six dimensions, in main memory or on a device. Copies share their numbers, and so
/// do views: narrow, select, view and their like. Functions that change numbers are const for that reason.
/// Negative dimensions count from the last one. The backend that CMake chooses (ARAPFIELDS_BACKEND) does the
/// work: libtorch, or Eigen in main memory alone. Operations run on the calling thread.
class Tensor {
 public:
  struct Array;  // the backend's
  Tensor() = default;
  explicit Tensor(std::shared_ptr<Array> array) : array_(std::move(array)) {}

  bool defined() const { return array_ != nullptr; }
  NumberType type() const;
  bool is_double() const { return type() == NumberType::float64; }
  bool on_host() const;
  bool is_contiguous() const;
  Index dims() const;
  Index size(Index dimension) const;
  Index stride(Index dimension) const;
  Index count() const;
  /// The first number; the tensor must be in main memory and have this type.
  template <class Number>
  Number* data() const {
    return static_cast<Number*>(raw());
  }
  /// The number of a tensor of one; waits for the device.
  double number() const;

  // Views.
  Tensor narrow(Index dimension, Index begin, Index length) const;
  Tensor slice(Index dimension, Index begin, Index end) const {
    return narrow(dimension, begin, end - begin);
  }
  Tensor from(Index dimension, Index begin) const { return slice(dimension, begin, size(dimension)); }
  Tensor select(Index dimension, Index i) const;
  Tensor operator[](Index i) const { return select(0, i); }
  Tensor transpose(Index a, Index b) const;
  Tensor t() const { return transpose(0, 1); }
  Tensor permute(SizeList order) const;
  Tensor unsqueeze(Index dimension) const;
  Tensor expand(SizeList sizes) const;
  /// One size may be −1: what is left. view() needs numbers without gaps; reshape() copies where it must.
  Tensor view(SizeList sizes) const;
  Tensor view_like(const Tensor& other) const;
  Tensor reshape(SizeList sizes) const { return contiguous().view(sizes); }
  Tensor flat() const { return view({-1}); }

  // Copies.
  Tensor clone() const;  ///< contiguous
  Tensor contiguous() const { return is_contiguous() ? *this : clone(); }
  Tensor to(NumberType type) const;  ///< the same where it has this type
  Tensor to_host() const;
  /// On the device of `other`; does not wait for it, as the way there leads through page-locked memory.
  Tensor to_device_of(const Tensor& other) const;
  Tensor to_device(const std::string& name) const;

  // In place. The other operand is broadcast, and converted where its type differs.
  const Tensor& assign(const Tensor& from) const;
  const Tensor& fill(double value) const;
  const Tensor& set_zero() const { return fill(0.0); }
  const Tensor& add(const Tensor& other, double factor = 1.0) const;
  const Tensor& operator+=(const Tensor& other) const { return add(other); }
  const Tensor& operator+=(double number) const;
  const Tensor& operator-=(const Tensor& other) const { return add(other, -1.0); }
  const Tensor& operator*=(const Tensor& other) const;
  const Tensor& operator*=(double number) const;
  const Tensor& operator/=(const Tensor& other) const;
  const Tensor& operator/=(double number) const;
  const Tensor& add_product(const Tensor& a, const Tensor& b, double factor = 1.0) const;   ///< a∘b
  const Tensor& add_quotient(const Tensor& a, const Tensor& b, double factor = 1.0) const;  ///< a/b

  const Array& array() const { return *array_; }

 private:
  void* raw() const;
  std::shared_ptr<Array> array_;
};

/// Whether both have one type and lie on one device.
bool alike(const Tensor& a, const Tensor& b);
bool same_sizes(const Tensor& a, const Tensor& b);
bool is_same(const Tensor& a, const Tensor& b);  ///< the same numbers in memory, in the same order

}  // namespace arapfields
