// SPDX-License-Identifier: GPL-3.0-or-later
// libtorch behind the tensors: for this folder alone.
#pragma once

#include <ATen/ATen.h>
#include <ATen/core/LegacyTypeDispatch.h>

#include "tensors/tensor.h"

namespace arapfields {

struct Tensor::Array {
  at::Tensor tensor;
};

inline const at::Tensor& aten(const Tensor& tensor) { return tensor.array().tensor; }
inline at::IntArrayRef aten(SizeList sizes) { return {sizes.begin(), sizes.size()}; }
inline at::ScalarType aten(NumberType type) {
  constexpr at::ScalarType types[] = {at::kFloat, at::kDouble, at::kLong, at::kBFloat16};
  return types[static_cast<int>(type)];
}

/// While one lives, libtorch keeps no record for derivatives: what stands in the same expression as
/// `Plain()(…)` runs with plain kernels.
class Plain {
 public:
  Tensor operator()(at::Tensor tensor) const {
    return Tensor(std::make_shared<Tensor::Array>(Tensor::Array{std::move(tensor)}));
  }

 private:
  at::AutoDispatchBelowADInplaceOrView guard_;
};

}  // namespace arapfields
