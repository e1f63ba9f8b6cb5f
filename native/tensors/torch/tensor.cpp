// SPDX-License-Identifier: GPL-3.0-or-later
#include "tensors/tensor.h"

#include "tensors/torch/array.h"

namespace arapfields {

NumberType Tensor::type() const {
  switch (aten(*this).scalar_type()) {
    case at::kDouble:
      return NumberType::float64;
    case at::kLong:
      return NumberType::int64;
    case at::kBFloat16:
      return NumberType::bfloat16;
    default:
      return NumberType::float32;
  }
}
bool Tensor::on_host() const { return aten(*this).is_cpu(); }
bool Tensor::is_contiguous() const { return aten(*this).is_contiguous(); }
Index Tensor::dims() const { return aten(*this).dim(); }
Index Tensor::size(Index dimension) const { return aten(*this).size(dimension); }
Index Tensor::stride(Index dimension) const { return aten(*this).stride(dimension); }
Index Tensor::count() const { return aten(*this).numel(); }
void* Tensor::raw() const { return aten(*this).data_ptr(); }
double Tensor::number() const { return aten(*this).item<double>(); }

Tensor Tensor::narrow(Index dimension, Index begin, Index length) const {
  return Plain()(aten(*this).narrow(dimension, begin, length));
}
Tensor Tensor::select(Index dimension, Index i) const { return Plain()(aten(*this).select(dimension, i)); }
Tensor Tensor::transpose(Index a, Index b) const { return Plain()(aten(*this).transpose(a, b)); }
Tensor Tensor::permute(SizeList order) const { return Plain()(aten(*this).permute(aten(order))); }
Tensor Tensor::unsqueeze(Index dimension) const { return Plain()(aten(*this).unsqueeze(dimension)); }
Tensor Tensor::expand(SizeList sizes) const { return Plain()(aten(*this).expand(aten(sizes))); }
Tensor Tensor::view(SizeList sizes) const { return Plain()(aten(*this).view(aten(sizes))); }
Tensor Tensor::view_like(const Tensor& other) const { return Plain()(aten(*this).view(aten(other).sizes())); }

Tensor Tensor::clone() const { return Plain()(aten(*this).clone(at::MemoryFormat::Contiguous)); }
Tensor Tensor::to(NumberType type) const { return Plain()(aten(*this).to(aten(type))); }
Tensor Tensor::to_host() const { return Plain()(aten(*this).to(at::kCPU)); }
Tensor Tensor::to_device_of(const Tensor& other) const {
  if (other.on_host()) return *this;
  return Plain()(aten(*this).pin_memory().to(aten(other).device(), true));
}
Tensor Tensor::to_device(const std::string& name) const { return Plain()(aten(*this).to(at::Device(name))); }

const Tensor& Tensor::assign(const Tensor& from) const {
  return Plain()(aten(*this).copy_(aten(from))), *this;
}
const Tensor& Tensor::fill(double value) const { return Plain()(aten(*this).fill_(value)), *this; }
const Tensor& Tensor::add(const Tensor& other, double factor) const {
  return Plain()(aten(*this).add_(aten(other), factor)), *this;
}
const Tensor& Tensor::operator+=(double number) const { return Plain()(aten(*this).add_(number)), *this; }
const Tensor& Tensor::operator*=(const Tensor& other) const {
  return Plain()(aten(*this).mul_(aten(other))), *this;
}
const Tensor& Tensor::operator*=(double number) const { return Plain()(aten(*this).mul_(number)), *this; }
const Tensor& Tensor::operator/=(const Tensor& other) const {
  return Plain()(aten(*this).div_(aten(other))), *this;
}
const Tensor& Tensor::operator/=(double number) const { return Plain()(aten(*this).div_(number)), *this; }
const Tensor& Tensor::add_product(const Tensor& a, const Tensor& b, double factor) const {
  return Plain()(aten(*this).addcmul_(aten(a), aten(b), factor)), *this;
}
const Tensor& Tensor::add_quotient(const Tensor& a, const Tensor& b, double factor) const {
  return Plain()(aten(*this).addcdiv_(aten(a), aten(b), factor)), *this;
}

bool alike(const Tensor& a, const Tensor& b) {
  return aten(a).scalar_type() == aten(b).scalar_type() && aten(a).device() == aten(b).device();
}
bool same_sizes(const Tensor& a, const Tensor& b) { return aten(a).sizes() == aten(b).sizes(); }
bool is_same(const Tensor& a, const Tensor& b) { return aten(a).is_same(aten(b)); }

}  // namespace arapfields
