// SPDX-License-Identifier: GPL-3.0-or-later
// The tensors' arrays in main memory and the loops over them: for this folder alone.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "tensors/operations.h"

namespace arapfields {

constexpr std::size_t most_dims = 6;
/// What standard containers are indexed with.
inline std::size_t as_size(Index i) { return static_cast<std::size_t>(i); }

/// Rows of numbers `step` apart: what a loop over a tensor's numbers meets.
using Extents = std::array<Index, most_dims>;

struct Tensor::Array {
  std::shared_ptr<void> owner;  // none where the memory is another's
  char* data = nullptr;
  NumberType type = NumberType::float32;
  int dims = 0;
  Extents sizes{};
  Extents strides{};

  template <class Number>
  Number* numbers() const {
    return reinterpret_cast<Number*>(data);
  }
};

/// A new array without gaps.
Tensor make_tensor(const Index* sizes, int dims, NumberType type);
/// Sizes that both broadcast to.
Tensor make_broadcast(const Tensor& a, const Tensor& b, NumberType type);
/// The strides of `a` for a loop over `sizes`: 0 where it is broadcast.
Extents strides_in(const Tensor::Array& a, const Tensor::Array& sizes);
Index wrapped(const Tensor& tensor, Index dimension);
inline Index number_bytes(NumberType type) {
  return type == NumberType::float64 || type == NumberType::int64 ? 8 : 4;
}
/// Rounds the numbers of a tensor of type bfloat16, which are kept in single precision.
void round_bfloat16(const Tensor& tensor);

/// use(Number()) for the type that holds the tensor's numbers.
template <class Use>
void with_type(NumberType type, Use&& use) {
  if (type == NumberType::float64)
    use(double());
  else if (type == NumberType::int64)
    use(Index());
  else
    use(float());
}

/// body(offsets, length, steps) for each row of a loop over `sizes`, given each operand's strides: dimensions
/// that follow on one another for all operands are one.
template <std::size_t operands, class Body>
void for_rows(const Tensor::Array& sizes, const std::array<Extents, operands>& strides, Body&& body) {
  struct Level {
    Index size;
    std::array<Index, operands> steps;
  };
  std::array<Level, most_dims> levels;  // the innermost first
  std::size_t depth = 0;
  for (int d = sizes.dims - 1; d >= 0; --d) {
    const std::size_t i = as_size(d);
    if (sizes.sizes[i] == 0) return;
    if (sizes.sizes[i] == 1) continue;
    bool follows = depth > 0;
    for (std::size_t k = 0; k < operands && follows; ++k)
      follows = strides[k][i] == levels[depth - 1].steps[k] * levels[depth - 1].size;
    if (follows) {
      levels[depth - 1].size *= sizes.sizes[i];
      continue;
    }
    levels[depth].size = sizes.sizes[i];
    for (std::size_t k = 0; k < operands; ++k) levels[depth].steps[k] = strides[k][i];
    ++depth;
  }
  if (depth == 0) levels[depth++] = {1, {}};
  std::array<Index, operands> offsets{};
  std::array<Index, most_dims> place{};
  for (;;) {
    body(offsets, levels[0].size, levels[0].steps);
    std::size_t level = 1;
    for (; level < depth; ++level) {
      for (std::size_t k = 0; k < operands; ++k) offsets[k] += levels[level].steps[k];
      if (++place[level] < levels[level].size) break;
      for (std::size_t k = 0; k < operands; ++k) offsets[k] -= levels[level].steps[k] * levels[level].size;
      place[level] = 0;
    }
    if (level == depth) return;
  }
}

/// out = f(inputs…), element by element; the inputs are broadcast to out, and all have its type.
template <class Number, class F, class... Inputs>
void apply(const Tensor::Array& out, const F& f, const Inputs&... inputs) {
  constexpr std::size_t count = 1 + sizeof...(Inputs);
  const std::array<Extents, count> strides{out.strides, strides_in(inputs, out)...};
  const std::array<Number*, count> data{out.numbers<Number>(), inputs.template numbers<Number>()...};
  for_rows<count>(out, strides, [&](const auto& offsets, Index length, const auto& steps) {
    bool dense = true;
    for (const Index step : steps) dense = dense && step == 1;
    const auto row = [&]<std::size_t... k>(std::index_sequence<k...>) {
      Number* const to = data[0] + offsets[0];
      if (dense)
        for (Index i = 0; i < length; ++i) to[i] = f(data[k + 1][offsets[k + 1] + i]...);
      else
        for (Index i = 0; i < length; ++i)
          to[i * steps[0]] = f(data[k + 1][offsets[k + 1] + i * steps[k + 1]]...);
    };
    row(std::make_index_sequence<sizeof...(Inputs)>());
  });
}

}  // namespace arapfields
