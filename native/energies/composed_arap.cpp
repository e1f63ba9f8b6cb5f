// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>

#include "core/jets.h"
#include "energies/composed_energies.h"
#include "energies/kernels.h"
#include "tensors/operations.h"
#include "tensors/views.h"

namespace arapfields {
namespace {

template <std::size_t size>
Tensor table(const std::array<double, size>& numbers, SizeList sizes, const Tensor& like) {
  return tensor_like(tensor_view(numbers.data(), sizes), like);
}

template <std::size_t size>
Tensor table(const std::array<Index, size>& numbers, const Tensor& like) {
  return upload(tensor_view(numbers.data(), {static_cast<Index>(size)}), like);
}

std::array<double, 9 * 16> davenport_entries() {
  std::array<double, 9 * 16> entries{};
  const auto set = [&](int row, int column, int i, int k, double value) {
    entries[static_cast<std::size_t>((3 * i + k) * 16 + 4 * row + column)] = value;
    entries[static_cast<std::size_t>((3 * i + k) * 16 + 4 * column + row)] = value;
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

/// Matrix i exchanges columns i and 0.
std::array<double, 4 * 16> exchanges() {
  std::array<double, 4 * 16> entries{};
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t k = 0; k < 4; ++k) entries[16 * i + 4 * k + (k == i ? 0 : k == 0 ? i : k)] = 1.0;
  return entries;
}

/// A round of the cyclic Jacobi method rotates in the planes (0,1) and (2,3), then permutes columns
/// 0, 2, 3, 1 to 0, 1, 2, 3: after three rounds each pair was rotated once, and the permutations cancel. The
/// indices of the round's matrix in (c, c', s, s', −s, −s', 0).
constexpr std::array<Index, 16> turn_entries = {0, 6, 6, 2, 4, 6, 6, 0, 6, 1, 3, 6, 6, 5, 1, 6};

std::array<double, 54> pair_entries() {
  std::array<double, 54> entries{};
  for (int j = 0; j < 3; ++j)
    for (int k = 0; k < 3; ++k)
      entries[static_cast<std::size_t>((second_column(j, k) - 4) * 9 + 3 * k + j)] = 1.0;
  return entries;
}

Tensor axial_of(const Tensor& matrices, const EnergyTables& tables) {
  return product(matrices.reshape({-1, 9}), tables.axial);
}

/// [w]× of rows w, (…, 9).
Tensor cross_of(const Tensor& rows, const EnergyTables& tables) {
  return product(rows.reshape({-1, 3}), tables.axial.t());
}

}  // namespace

EnergyTables::EnergyTables(const Tensor& like)
    : davenport(table(davenport_entries(), {9, 16}, like)),
      turn(table(turn_entries, like)),
      diagonal(table(std::array<Index, 4>{0, 5, 10, 15}, like)),
      even(table(std::array<Index, 2>{0, 10}, like)),
      odd(table(std::array<Index, 2>{5, 15}, like)),
      pair(table(std::array<Index, 2>{1, 11}, like)),
      exchange(table(exchanges(), {4, 4, 4}, like)),
      entries(table(std::array<Index, 12>{1, 0, 3, 2, 2, 3, 0, 1, 3, 2, 1, 0}, like)),
      left(table(std::array<double, 12>{-1, 1, -1, 1, -1, 1, 1, -1, -1, -1, 1, 1}, {3, 4}, like)),
      right(table(std::array<double, 12>{-1, 1, 1, -1, -1, -1, 1, 1, -1, 1, -1, 1}, {3, 4}, like)),
      axial(table(std::array<double, 27>{0, 0,  0, 0, 0, -1, 0, 1, 0, 0, 0, 1, 0, 0,
                                         0, -1, 0, 0, 0, -1, 0, 1, 0, 0, 0, 0, 0},
                  {9, 3}, like)),
      slices(table(std::array<Index, 9>{4, 7, 8, 7, 5, 9, 8, 9, 6}, like)),
      pairs(table(pair_entries(), {6, 9}, like)),
      identity(table(std::array<double, 9>{1, 0, 0, 0, 1, 0, 0, 0, 1}, {3, 3}, like)),
      next_column(table(std::array<Index, 3>{2, 3, 1}, like)),
      last(table(std::array<Index, 3>{3, 1, 2}, like)),
      next_axis(table(std::array<Index, 3>{1, 2, 0}, like)),
      last_axis(table(std::array<Index, 3>{2, 0, 1}, like)) {}

ComposedPolar composed_polar(const Tensor& jacobians, const EnergyTables& tables) {
  const bool single = !jacobians.is_double();
  const int rounds = 3 * (single ? 6 : 8);
  const double tiny = single ? 1e-30 : 1e-200;
  const Index n = jacobians.size(0);
  const Tensor size = max(abs(jacobians.reshape({n, 9})), 1).unsqueeze(1);
  const Tensor scale = where_positive(size, size, ones_like(size));
  Tensor a = product(jacobians.reshape({n, 9}) / scale, tables.davenport).view({n, 4, 4});
  Tensor v;
  const Tensor zero = zeros({n, 2}, jacobians);
  for (int round = 0; round < rounds; ++round) {
    const Tensor entries = a.view({n, 16}), twice = 2 * index_select(entries, 1, tables.pair);
    const Tensor d = index_select(entries, 1, tables.odd) - index_select(entries, 1, tables.even);
    const Tensor tangent = twice / (d + copysign(hypot(d, twice) + tiny, d));
    const Tensor cosine = rsqrt(tangent * tangent + 1), sine = tangent * cosine;
    const Tensor q =
        index_select(stack({cosine, sine, -sine, zero}, 1).view({n, 8}), 1, tables.turn).view({n, 4, 4});
    a = batch_product(q.transpose(1, 2), batch_product(a, q));
    v = round == 0 ? q : batch_product(v, q);
  }
  const Tensor values = index_select(a.view({n, 16}), 1, tables.diagonal);
  const Tensor largest_first = index_select(tables.exchange, 0, argmax(values));
  const Tensor sorted = batch_product(values.unsqueeze(1), largest_first).view({n, 4});
  v = batch_product(v, largest_first);
  const Tensor top = v.select(2, 0);
  const Tensor unit = top * rsqrt(sum(top * top, {1}, true));
  const Tensor entries = index_select(unit, 1, tables.entries).view({n, 3, 4});
  const Tensor inner = entries * tables.right;
  ComposedPolar polar;
  polar.rotation = batch_product(entries * tables.left, inner.transpose(1, 2));
  polar.axes = batch_product(inner, v.from(2, 1));
  polar.sums = (sorted.slice(1, 0, 1) - sorted.from(1, 1)) * (0.5 * scale);
  return polar;
}

Tensor composed_arap(const Tensor& jets, double bending, double weight, const EnergyTables& tables,
                     Tensor cotangents, const ComposedFactors& factors) {
  const Index n = jets.size(1);
  const double share = 1.0 / static_cast<double>(std::max<Index>(n, 1));
  const Tensor jacobian = jets.slice(0, 1, 4).permute({1, 2, 0}).contiguous();
  const ComposedPolar polar = composed_polar(jacobian, tables);
  const Tensor &r = polar.rotation, rt = r.transpose(1, 2);
  const Tensor difference = jacobian - r;
  // Factors as (n, 1, 1): on the energy, and their product with those on the bending.
  const Tensor one = ones({1, 1, 1}, jets);
  const Tensor factor = factors.weights.defined() ? factors.weights.view({n, 1, 1}) : one;
  const Tensor stiffness = factors.bending.defined() ? factor * factors.bending.view({n, 1, 1}) : factor;
  const Tensor squares = difference * difference;
  const Tensor stretch = sum(squares) * share;
  Tensor gradient = difference * (factor * (2.0 * weight * share));
  Tensor bend = zeros_like(stretch);
  const Tensor weighted = sum(squares * factor) * share;
  Tensor energy = weighted.clone();
  if (jets.size(0) == 10) {
    const Tensor inverse = reciprocal(clamp_min(polar.sums, smallest_sum));
    const Tensor k_inverse = batch_product(polar.axes * inverse.unsqueeze(1), polar.axes.transpose(1, 2));
    // A matrix for each k side by side, (n, 3, 3k + j): D_k, A_k = Rᵀ D_k, [w_k]× and R [w_k]×.
    const Tensor slices = index_select(jets, 0, tables.slices).view({3, 3, n, 3});
    const Tensor a = batch_product(rt, slices.permute({2, 3, 1, 0}).reshape({n, 3, 9}));
    const Tensor axis = axial_of(a.view({n, 3, 3, 3}).transpose(1, 2), tables).view({n, 3, 3});
    const Tensor w = batch_product(axis, k_inverse);  // rows w_k
    const Tensor speeds = axis * w;
    bend = sum(speeds) * share;
    energy += sum(speeds * stiffness) * (bending * share);
    if (cotangents.defined() && bending != 0.0) {
      const double bend_weight = weight * bending * share;
      const Tensor cross = cross_of(w, tables).view({n, 3, 3, 3}).transpose(1, 2).reshape({n, 3, 9});
      const Tensor turned = (batch_product(r, cross) * stiffness).permute({2, 0, 1}).reshape({9, 3 * n});
      multiply(cotangents.slice(0, 4, 10).view({6, 3 * n}), tables.pairs, turned, 2.0 * bend_weight, 1.0);
      const Tensor trace = sum(w * w, {1, 2}, true);
      const Tensor b = trace * tables.identity - batch_product(w.transpose(1, 2), w);
      const Tensor m =
          batch_product(b, batch_product(rt, jacobian)) - 2.0 * batch_product(cross, a.transpose(1, 2));
      const Tensor z = batch_product(axial_of(m, tables).unsqueeze(1), k_inverse);
      gradient += (bend_weight * stiffness) * batch_product(r, cross_of(z, tables).view({n, 3, 3}) - b);
    }
  }
  if (cotangents.defined()) cotangents.slice(0, 1, 4).add(gradient.permute({2, 0, 1}));
  return stack({stretch, bend, energy, weighted}, 0);
}

}  // namespace arapfields
