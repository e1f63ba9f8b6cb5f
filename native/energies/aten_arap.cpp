// SPDX-License-Identifier: GPL-3.0-or-later
#include <ATen/ATen.h>

#include <array>

#include "core/jets.h"
#include "core/tensors.h"
#include "energies/aten_energies.h"

namespace arapfields {
namespace {

constexpr double smallest_sum = 0.01;  // as in arap_kernel.cpp

template <std::size_t size>
at::Tensor table(const std::array<double, size>& numbers, at::IntArrayRef sizes, const at::Tensor& like) {
  const at::Tensor host = at::empty(sizes, at::kDouble);
  std::copy(numbers.begin(), numbers.end(), host.data_ptr<double>());
  return upload(host.to(like.scalar_type()), like);
}

template <std::size_t size>
at::Tensor table(const std::array<int64_t, size>& numbers, at::IntArrayRef sizes, const at::Tensor& like) {
  const at::Tensor host = at::empty(sizes, at::kLong);
  std::copy(numbers.begin(), numbers.end(), host.data_ptr<int64_t>());
  return upload(host, like);
}

std::array<double, 9 * 16> davenport_entries() {
  std::array<double, 9 * 16> entries{};
  const auto set = [&](int row, int column, int i, int k, double value) {
    entries[(3 * i + k) * 16 + 4 * row + column] = value;
    entries[(3 * i + k) * 16 + 4 * column + row] = value;
  };
  for (int c = 0; c < 4; ++c)
    for (int i = 0; i < 3; ++i) set(c, c, i, i, c == 0 || c == i + 1 ? 1.0 : -1.0);
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    set(0, i + 1, k, j, 1.0), set(0, i + 1, j, k, -1.0);
    set(j + 1, k + 1, j, k, 1.0), set(j + 1, k + 1, k, j, 1.0);
  }
  return entries;
}

/// A round turns the pairs (0,1) and (2,3) and then moves columns 0, 2, 3, 1 to 0, 1, 2, 3: after three
/// rounds every pair has had its turn and all are home. Of (c, c', s, s', −s, −s', 0) this is the matrix.
constexpr std::array<int64_t, 16> turn_entries = {0, 6, 6, 2, 4, 6, 6, 0, 6, 1, 3, 6, 6, 5, 1, 6};

std::array<double, 54> pair_entries() {
  std::array<double, 54> entries{};
  for (int j = 0; j < 3; ++j)
    for (int k = 0; k < 3; ++k) entries[(second_column(j, k) - 4) * 9 + 3 * k + j] = 1.0;
  return entries;
}

at::Tensor axial_of(const at::Tensor& matrices, const EnergyTables& tables) {
  return at::mm(matrices.reshape({-1, 9}), tables.axial);
}

/// [w]× of rows w, (…, 9).
at::Tensor cross_of(const at::Tensor& rows, const EnergyTables& tables) {
  return at::mm(rows.reshape({-1, 3}), tables.axial.t());
}

}  // namespace

EnergyTables::EnergyTables(const at::Tensor& like)
    : davenport(table(davenport_entries(), {9, 16}, like)),
      turn(table(turn_entries, {16}, like)),
      orders(table(std::array<int64_t, 16>{0, 1, 2, 3, 1, 0, 2, 3, 2, 1, 0, 3, 3, 1, 2, 0}, {4, 4}, like)),
      entries(table(std::array<int64_t, 12>{1, 0, 3, 2, 2, 3, 0, 1, 3, 2, 1, 0}, {12}, like)),
      left(table(std::array<double, 12>{-1, 1, -1, 1, -1, 1, 1, -1, -1, -1, 1, 1}, {3, 4}, like)),
      right(table(std::array<double, 12>{-1, 1, 1, -1, -1, -1, 1, 1, -1, 1, -1, 1}, {3, 4}, like)),
      axial(table(std::array<double, 27>{0, 0,  0, 0, 0, -1, 0, 1, 0, 0, 0, 1, 0, 0,
                                         0, -1, 0, 0, 0, -1, 0, 1, 0, 0, 0, 0, 0},
                  {9, 3}, like)),
      slices(table(std::array<int64_t, 9>{4, 7, 8, 7, 5, 9, 8, 9, 6}, {9}, like)),
      pairs(table(pair_entries(), {6, 9}, like)),
      identity(table(std::array<double, 9>{1, 0, 0, 0, 1, 0, 0, 0, 1}, {3, 3}, like)),
      next_column(table(std::array<int64_t, 3>{2, 3, 1}, {3}, like)),
      last(table(std::array<int64_t, 3>{3, 1, 2}, {3}, like)) {}

AtenPolar aten_polar(const at::Tensor& jacobians, const EnergyTables& tables) {
  const bool single = jacobians.scalar_type() == at::kFloat;
  const int rounds = 3 * (single ? 6 : 8);
  const double tiny = single ? 1e-30 : 1e-200;
  const int64_t n = jacobians.size(0);
  const at::Tensor size = jacobians.abs().amax({1, 2}).unsqueeze(1);
  const at::Tensor scale = at::where(size > 0, size, at::ones_like(size));
  at::Tensor a = at::mm(jacobians.reshape({n, 9}) / scale, tables.davenport).view({n, 4, 4});
  at::Tensor v;
  const at::Tensor zero = at::zeros({n, 1}, jacobians.options());
  for (int round = 0; round < rounds; ++round) {
    const at::Tensor diagonal = a.diagonal(0, 1, 2);
    const at::Tensor twice = 2 * a.diagonal(1, 1, 2).slice(1, 0, 3, 2);
    const at::Tensor d = diagonal.slice(1, 1, 4, 2) - diagonal.slice(1, 0, 4, 2);
    const at::Tensor tangent = twice / (d + at::copysign(at::hypot(d, twice).add_(tiny), d));
    const at::Tensor cosine = at::rsqrt(tangent * tangent + 1), sine = tangent * cosine;
    const at::Tensor q =
        at::index_select(at::cat({cosine, sine, -sine, zero}, 1), 1, tables.turn).view({n, 4, 4});
    a = at::bmm(q.transpose(1, 2), at::bmm(a, q));
    v = round == 0 ? q : at::bmm(v, q);
  }
  const at::Tensor values = a.diagonal(0, 1, 2);
  const at::Tensor order = at::index_select(tables.orders, 0, values.argmax(1));
  const at::Tensor sorted = values.gather(1, order);
  v = v.gather(2, order.unsqueeze(1).expand({n, 4, 4}));
  const at::Tensor top = v.select(2, 0);
  const at::Tensor unit = top * at::rsqrt((top * top).sum(1, true));
  const at::Tensor entries = at::index_select(unit, 1, tables.entries).view({n, 3, 4});
  const at::Tensor inner = entries * tables.right;
  AtenPolar polar;
  polar.rotation = at::bmm(entries * tables.left, inner.transpose(1, 2));
  polar.axes = at::bmm(inner, v.slice(2, 1));
  polar.sums = (sorted.slice(1, 0, 1) - sorted.slice(1, 1)) * (0.5 * scale);
  return polar;
}

at::Tensor aten_arap(const at::Tensor& jets, double bending, double weight, const EnergyTables& tables,
                     at::Tensor cotangents, const AtenFactors& factors) {
  const int64_t n = jets.size(1);
  const double share = 1.0 / static_cast<double>(std::max<int64_t>(n, 1));
  const at::Tensor jacobian = jets.slice(0, 1, 4).permute({1, 2, 0}).contiguous();
  const AtenPolar polar = aten_polar(jacobian, tables);
  const at::Tensor &r = polar.rotation, rt = r.transpose(1, 2);
  const at::Tensor difference = jacobian - r;
  // Factors as (n, 1, 1): on the energy, and on the bending, which the energy's one holds for too.
  const at::Tensor one = at::ones({1, 1, 1}, jets.options());
  const at::Tensor factor = factors.weights.defined() ? factors.weights.view({n, 1, 1}) : one;
  const at::Tensor stiffness = factors.bending.defined() ? factor * factors.bending.view({n, 1, 1}) : factor;
  const at::Tensor squares = difference * difference;
  const at::Tensor stretch = squares.sum() * share;
  at::Tensor gradient = difference * (factor * (2.0 * weight * share));
  at::Tensor bend = at::zeros_like(stretch);
  const at::Tensor weighted = (squares * factor).sum() * share;
  at::Tensor energy = weighted.clone();
  if (jets.size(0) == 10) {
    const at::Tensor inverse = at::clamp_min(polar.sums, smallest_sum).reciprocal();
    const at::Tensor k_inverse = at::bmm(polar.axes * inverse.unsqueeze(1), polar.axes.transpose(1, 2));
    // A matrix for each k side by side, (n, 3, 3k + j): D_k, A_k = Rᵀ D_k, [w_k]× and R [w_k]×.
    const at::Tensor slices = at::index_select(jets, 0, tables.slices).view({3, 3, n, 3});
    const at::Tensor a = at::bmm(rt, slices.permute({2, 3, 1, 0}).reshape({n, 3, 9}));
    const at::Tensor axis = axial_of(a.view({n, 3, 3, 3}).transpose(1, 2), tables).view({n, 3, 3});
    const at::Tensor w = at::bmm(axis, k_inverse);  // rows w_k
    const at::Tensor speeds = axis * w;
    bend = speeds.sum() * share;
    energy += (speeds * stiffness).sum() * (bending * share);
    if (cotangents.defined() && bending != 0.0) {
      const double bend_weight = weight * bending * share;
      const at::Tensor cross = cross_of(w, tables).view({n, 3, 3, 3}).transpose(1, 2).reshape({n, 3, 9});
      const at::Tensor turned = (at::bmm(r, cross) * stiffness).permute({2, 0, 1}).reshape({9, 3 * n});
      cotangents.slice(0, 4, 10).view({6, 3 * n}).addmm_(tables.pairs, turned, 1.0, 2.0 * bend_weight);
      const at::Tensor trace = (w * w).sum({1, 2}, true);
      const at::Tensor b = trace * tables.identity - at::bmm(w.transpose(1, 2), w);
      const at::Tensor m = at::bmm(b, at::bmm(rt, jacobian)) - 2.0 * at::bmm(cross, a.transpose(1, 2));
      const at::Tensor z = at::bmm(axial_of(m, tables).unsqueeze(1), k_inverse);
      gradient += (bend_weight * stiffness) * at::bmm(r, cross_of(z, tables).view({n, 3, 3}) - b);
    }
  }
  if (cotangents.defined()) cotangents.slice(0, 1, 4).add_(gradient.permute({2, 0, 1}));
  return at::stack({stretch, bend, energy, weighted});
}

}  // namespace arapfields
