// SPDX-License-Identifier: GPL-3.0-or-later
#include "tensors/operations.h"

#include "tensors/torch/array.h"

namespace arapfields {

Tensor empty(SizeList sizes, NumberType type) { return Plain()(at::empty(aten(sizes), aten(type))); }
Tensor zeros(SizeList sizes, NumberType type) { return Plain()(at::zeros(aten(sizes), aten(type))); }
Tensor empty(SizeList sizes, const Tensor& like) {
  return Plain()(at::empty(aten(sizes), aten(like).options()));
}
Tensor zeros(SizeList sizes, const Tensor& like) {
  return Plain()(at::zeros(aten(sizes), aten(like).options()));
}
Tensor ones(SizeList sizes, const Tensor& like) {
  return Plain()(at::ones(aten(sizes), aten(like).options()));
}
Tensor empty_like(const Tensor& like) { return Plain()(at::empty_like(aten(like))); }
Tensor zeros_like(const Tensor& like) { return Plain()(at::zeros_like(aten(like))); }
Tensor ones_like(const Tensor& like) { return Plain()(at::ones_like(aten(like))); }
Tensor scalar(double value) { return Plain()(at::scalar_tensor(value, at::kDouble)); }
Tensor view_memory(void* data, NumberType type, SizeList sizes, SizeList strides) {
  if (strides.size() == 0) return Plain()(at::from_blob(data, aten(sizes), aten(type)));
  return Plain()(at::from_blob(data, aten(sizes), aten(strides), aten(type)));
}

Tensor operator+(const Tensor& a, const Tensor& b) { return Plain()(at::add(aten(a), aten(b))); }
Tensor operator-(const Tensor& a, const Tensor& b) { return Plain()(at::sub(aten(a), aten(b))); }
Tensor operator*(const Tensor& a, const Tensor& b) { return Plain()(at::mul(aten(a), aten(b))); }
Tensor operator/(const Tensor& a, const Tensor& b) { return Plain()(at::div(aten(a), aten(b))); }
Tensor operator+(const Tensor& a, double b) { return Plain()(at::add(aten(a), b)); }
Tensor operator*(const Tensor& a, double b) { return Plain()(at::mul(aten(a), b)); }
Tensor operator/(const Tensor& a, double b) { return Plain()(at::div(aten(a), b)); }
Tensor operator/(double a, const Tensor& b) { return Plain()(a / aten(b)); }
Tensor operator-(const Tensor& a) { return Plain()(at::neg(aten(a))); }
Tensor operator-(double a, const Tensor& b) { return Plain()(a - aten(b)); }
Tensor hypot(const Tensor& a, const Tensor& b) { return Plain()(at::hypot(aten(a), aten(b))); }
Tensor copysign(const Tensor& magnitude, const Tensor& sign) {
  return Plain()(at::copysign(aten(magnitude), aten(sign)));
}

Tensor abs(const Tensor& a) { return Plain()(at::abs(aten(a))); }
Tensor sign(const Tensor& a) { return Plain()(at::sign(aten(a))); }
Tensor square(const Tensor& a) { return Plain()(at::square(aten(a))); }
Tensor sqrt(const Tensor& a) { return Plain()(at::sqrt(aten(a))); }
Tensor rsqrt(const Tensor& a) { return Plain()(at::rsqrt(aten(a))); }
Tensor reciprocal(const Tensor& a) { return Plain()(at::reciprocal(aten(a))); }
Tensor exp(const Tensor& a) { return Plain()(at::exp(aten(a))); }
Tensor log1p(const Tensor& a) { return Plain()(at::log1p(aten(a))); }
Tensor sigmoid(const Tensor& a) { return Plain()(at::sigmoid(aten(a))); }
Tensor sin(const Tensor& a) { return Plain()(at::sin(aten(a))); }
Tensor cos(const Tensor& a) { return Plain()(at::cos(aten(a))); }
Tensor clamp_min(const Tensor& a, double least) { return Plain()(at::clamp_min(aten(a), least)); }
Tensor where_positive(const Tensor& condition, const Tensor& a, const Tensor& b) {
  return Plain()(at::where(aten(condition) > 0, aten(a), aten(b)));
}

Tensor sum(const Tensor& a) { return Plain()(at::sum(aten(a))); }
Tensor sum(const Tensor& a, SizeList dimensions, bool keep) {
  return Plain()(at::sum(aten(a), aten(dimensions), keep));
}
Tensor mean(const Tensor& a) { return Plain()(at::mean(aten(a))); }
Tensor max(const Tensor& a) { return Plain()(at::max(aten(a))); }
Tensor max(const Tensor& a, Index dimension) { return Plain()(at::amax(aten(a), {dimension})); }
Tensor argmax(const Tensor& a) { return Plain()(at::argmax(aten(a), -1)); }
Tensor norm(const Tensor& a) { return Plain()(at::norm(aten(a))); }
bool all_finite(const Tensor& a) {
  const at::AutoDispatchBelowADInplaceOrView guard;
  return at::isfinite(aten(a)).all().item<bool>();
}

Tensor stack(const std::vector<Tensor>& tensors, Index dimension) {
  std::vector<at::Tensor> all;
  for (const Tensor& tensor : tensors) all.push_back(aten(tensor));
  return Plain()(at::stack(all, dimension));
}
Tensor index_select(const Tensor& a, Index dimension, const Tensor& which) {
  return Plain()(at::index_select(aten(a), dimension, aten(which)));
}
Tensor cross(const Tensor& a, const Tensor& b) { return Plain()(at::linalg_cross(aten(a), aten(b))); }

Tensor product(const Tensor& a, const Tensor& b) { return Plain()(at::mm(aten(a), aten(b))); }
void multiply(const Tensor& c, const Tensor& a, const Tensor& b, double factor, double kept) {
  const at::AutoDispatchBelowADInplaceOrView guard;
  at::Tensor out = aten(c);
  if (factor == 1.0 && kept == 0.0)
    at::mm_out(out, aten(a), aten(b));
  else
    at::addmm_out(out, out, aten(a), aten(b), kept, factor);
}
Tensor batch_product(const Tensor& a, const Tensor& b) { return Plain()(at::bmm(aten(a), aten(b))); }
void multiply_elements(const Tensor& c, const Tensor& a, const Tensor& b) {
  const at::AutoDispatchBelowADInplaceOrView guard;
  at::Tensor out = aten(c);
  at::mul_out(out, aten(a), aten(b));
}

Tensor cholesky_factor(const Tensor& a) {
  const at::AutoDispatchBelowADInplaceOrView guard;
  const auto [factor, info] = at::linalg_cholesky_ex(aten(a));
  return info.item<int>() == 0 ? Plain()(factor) : Tensor();
}
Tensor solve_triangular(const Tensor& a, const Tensor& b, bool upper, Side side) {
  return Plain()(at::linalg_solve_triangular(aten(a), aten(b), upper, side == Side::left));
}
Tensor solve_by_factor(const Tensor& lower, const Tensor& b) {
  return Plain()(at::cholesky_solve(aten(b), aten(lower)));
}

}  // namespace arapfields
