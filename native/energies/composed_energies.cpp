// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/composed_energies.h"

#include <array>

#include "core/jets.h"
#include "energies/kernels.h"
#include "energies/stance.h"
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

namespace {

constexpr double shortest = 1e-3;  // as in gauss_kernel.cpp

Tensor dots(const Tensor& a, const Tensor& b) { return sum(a * b, {-1}, true); }

Tensor mean_row(const Tensor& rows) {
  return sum(rows, {0}, true) / static_cast<double>(std::max<Index>(rows.size(0), 1));
}

/// Of a symmetric matrix (3, 3): its cofactors over its determinant.
Tensor inverse_of(const Tensor& matrix, const EnergyTables& tables) {
  const Tensor cofactors =
      cross(index_select(matrix, 0, tables.next_axis), index_select(matrix, 0, tables.last_axis));
  return cofactors / sum(matrix[0] * cofactors[0]);
}

/// Columns of the cofactor matrix, (3, n, 3): minors_k = j_{k+1} × j_{k+2}.
Tensor minors_of(const Tensor& jets, const EnergyTables& tables) {
  return cross(index_select(jets, 0, tables.next_column), index_select(jets, 0, tables.last));
}

/// A style's loss (n,1) of unit normals (n,3), whose gradient is −factor · slope (n,3).
struct NormalLoss {
  Tensor loss, slope;
  double factor;
};

/// Mean of a loss of the deformed unit normals, and its cotangents.
template <class Loss>
Tensor of_normals(const Tensor& jets, const Tensor& normals, const Tensor& sample_weights, double weight,
                  const EnergyTables& tables, Tensor cotangents, const Loss& loss_of) {
  const double share = 1.0 / static_cast<double>(std::max<Index>(jets.size(1), 1));
  const Tensor minors = minors_of(jets, tables);
  const Tensor orientation = dots(jets[1], minors[0]);
  const Tensor one = ones_like(orientation), sign = where_positive(-orientation, -one, one);
  const Tensor columns = normals.t().unsqueeze(2);  // (3, n, 1)
  const Tensor image = sign * sum(columns * minors, {0});
  const Tensor length = sqrt(dots(image, image));
  const Tensor inverse = reciprocal(clamp_min(length, shortest));
  const Tensor unit = image * inverse;
  NormalLoss normal_loss = loss_of(unit);
  if (sample_weights.defined()) normal_loss.loss = normal_loss.loss * sample_weights.unsqueeze(1);
  if (cotangents.defined()) {
    const Tensor along = where_positive(length - shortest, dots(unit, normal_loss.slope), zeros_like(length));
    Tensor h = (normal_loss.slope - along * unit) * sign * inverse * (-weight * share * normal_loss.factor);
    if (sample_weights.defined()) h = h * sample_weights.unsqueeze(1);
    // Of j_k: h × (n_{k+1} j_{k+2} − n_{k+2} j_{k+1}).
    const Tensor arms =
        index_select(columns, 0, tables.next_axis) * index_select(jets, 0, tables.last) -
        index_select(columns, 0, tables.last_axis) * index_select(jets, 0, tables.next_column);
    cotangents.slice(0, 1, 4) += cross(h.unsqueeze(0).expand({3, h.size(0), 3}), arms);
  }
  return sum(normal_loss.loss) * share;
}

}  // namespace

Tensor composed_gauss(const Tensor& jets, const Tensor& normals, const Tensor& sample_weights,
                      const Tensor& preferred, double sharpness, double weight, const EnergyTables& tables,
                      Tensor cotangents) {
  const Tensor directions = preferred.slice(1, 0, 3);
  return of_normals(
      jets, normals, sample_weights, weight, tables, cotangents, [&](const Tensor& unit) -> NormalLoss {
        const Tensor terms =
            exp(sharpness * product(unit, directions.t())) * preferred.select(1, 3).unsqueeze(0);  // (n, k)
        return {1.0 - sum(terms, {1}, true), product(terms, directions), sharpness};
      });
}

Tensor composed_targets(const Tensor& jets, const Tensor& normals, const Tensor& sample_weights,
                        const Tensor& targets, double weight, const EnergyTables& tables, Tensor cotangents) {
  return of_normals(jets, normals, sample_weights, weight, tables, cotangents,
                    [&](const Tensor& unit) -> NormalLoss {
                      const Tensor off = targets - unit;
                      return {dots(off, off), off, 2.0};
                    });
}

Tensor composed_barrier(const Tensor& jets, double threshold, double weight, const EnergyTables& tables,
                        Tensor cotangents) {
  const double share = 1.0 / static_cast<double>(std::max<Index>(jets.size(1), 1));
  const Tensor minors = minors_of(jets, tables);
  const Tensor gap = clamp_min(1.0 - dots(jets[1], minors[0]) / threshold, 0.0);  // (n, 1)
  if (cotangents.defined()) cotangents.slice(0, 1, 4).add(gap * minors, -2.0 * weight * share / threshold);
  return sum(gap * gap) * share;
}

Tensor composed_handles(const Tensor& jets, const Tensor& targets, const Tensor& weights, double weight,
                        Tensor cotangents) {
  const Tensor difference = jets[0] - targets, scaled = weights.unsqueeze(1) * difference;
  if (cotangents.defined()) cotangents[0].add(scaled, 2.0 * weight);
  return sum(scaled * difference);
}

Tensor composed_stance(const Tensor& jets, const Tensor& rest, const Tensor& up, const Tensor& ground,
                       double weight, const EnergyTables& tables, Tensor cotangents) {
  const double share = 1.0 / static_cast<double>(std::max<Index>(jets.size(1), 1));
  const Tensor displacements = jets[0] - rest, touching = ground.unsqueeze(1);
  const Tensor others = displacements - mean_row(displacements),
               rises = product(displacements, up.unsqueeze(1));
  const Tensor uneven = rises - sum(touching * rises) / clamp_min(sum(ground), 1e-30);
  const Tensor lifted = touching * uneven;
  // The rotation vector closest to the displacements, without its vertical component; in float64, since the
  // inertia tensor is inverted.
  const Tensor arms = (rest - mean_row(rest)).to(NumberType::float64), upward = up.to(NumberType::float64);
  const Tensor size = clamp_min(sum(arms * arms), 1e-30);
  const Tensor inertia =
      (1.0 + Stance::thinnest) * size * tables.identity.to(NumberType::float64) - product(arms.t(), arms);
  const Tensor inverse = inverse_of(inertia, tables);
  const Tensor turn = sum(inverse * sum(cross(arms, displacements.to(NumberType::float64)), {0}), {1});
  const Tensor lean = turn - sum(turn * upward) * upward;
  const Tensor lean_torque =
      (Stance::lean_weight * size * sum(inverse * lean, {1})).expand({arms.size(0), 3});
  if (cotangents.defined())
    cotangents[0].add(others + lifted * up.unsqueeze(0) + cross(lean_torque, arms).to(jets.type()),
                      2.0 * weight * share);
  const Tensor leaning = Stance::lean_weight * size * sum(lean * lean);
  return (sum(others * others) + sum(lifted * uneven) + leaning.to(jets.type())) * share;
}

template <class Scalar>
ArapValue probe_arap(JetView<const Scalar> jets, double bending, double weight, JetView<Scalar> cotangents,
                     ArapFactors<Scalar> factors) {
  const Tensor given = tensor_view(jets);
  const auto per_point = [&](const Scalar* numbers) {
    if (numbers == nullptr) return Tensor();
    return tensor_view(numbers, {jets.count});
  };
  const ComposedFactors own{per_point(factors.weights), per_point(factors.bending)};
  const Tensor values =
      composed_arap(given, bending, weight, EnergyTables(given), tensor_view(cotangents), own)
          .to(NumberType::float64);
  return {values[0].number(), values[1].number(), values[2].number()};
}

template <class Scalar>
double probe_gauss(JetView<const Scalar> jets, ConstPointsRef<Scalar> normals,
                   const Eigen::Ref<const Eigen::VectorX<Scalar>>& sample_weights,
                   const GaussPreference& preference, double weight, JetView<Scalar> cotangents) {
  const Tensor given = tensor_view(jets);
  RowMatrix<double> rows(preference.normals.rows(), 4);
  rows << preference.normals, preference.weights;
  const Tensor weights = sample_weights.size() > 0 ? tensor_view(sample_weights) : Tensor();
  return composed_gauss(given, tensor_view(normals), weights, tensor_view(rows).to(given.type()),
                        preference.sharpness, weight, EnergyTables(given), tensor_view(cotangents))
      .number();
}

template <class Scalar>
double probe_targets(JetView<const Scalar> jets, ConstPointsRef<Scalar> normals,
                     ConstPointsRef<Scalar> targets,
                     const Eigen::Ref<const Eigen::VectorX<Scalar>>& sample_weights, double weight,
                     JetView<Scalar> cotangents) {
  const Tensor given = tensor_view(jets);
  const Tensor weights = sample_weights.size() > 0 ? tensor_view(sample_weights) : Tensor();
  return composed_targets(given, tensor_view(normals), weights, tensor_view(targets), weight,
                          EnergyTables(given), tensor_view(cotangents))
      .number();
}

template <class Scalar>
double probe_barrier(JetView<const Scalar> jets, double threshold, double weight,
                     JetView<Scalar> cotangents) {
  const Tensor given = tensor_view(jets);
  return composed_barrier(given, threshold, weight, EnergyTables(given), tensor_view(cotangents)).number();
}

template <class Scalar>
double probe_handles(JetView<const Scalar> jets, const HandleBatch<Scalar>& batch, double weight,
                     JetView<Scalar> cotangents) {
  return composed_handles(tensor_view(jets), tensor_view(batch.targets), tensor_view(batch.weights), weight,
                          tensor_view(cotangents))
      .number();
}

template <class Scalar>
double probe_stance(JetView<const Scalar> jets, ConstPointsRef<Scalar> rest, const Stance& stance,
                    double weight, JetView<Scalar> cotangents) {
  const Tensor given = tensor_view(jets);
  const Vector up = stance.up;
  return stance.scale * composed_stance(given, tensor_view(rest), tensor_view(up).to(given.type()),
                                        tensor_view(stance.ground).to(given.type()), weight * stance.scale,
                                        EnergyTables(given), tensor_view(cotangents))
                            .number();
}

#define ARAPFIELDS_PROBES(Scalar)                                                                            \
  template ArapValue probe_arap<Scalar>(JetView<const Scalar>, double, double, JetView<Scalar>,              \
                                        ArapFactors<Scalar>);                                                \
  template double probe_gauss<Scalar>(JetView<const Scalar>, ConstPointsRef<Scalar>,                         \
                                      const Eigen::Ref<const Eigen::VectorX<Scalar>>&,                       \
                                      const GaussPreference&, double, JetView<Scalar>);                      \
  template double probe_targets<Scalar>(                                                                     \
      JetView<const Scalar>, ConstPointsRef<Scalar>, ConstPointsRef<Scalar>,                                 \
      const Eigen::Ref<const Eigen::VectorX<Scalar>>&, double, JetView<Scalar>);                             \
  template double probe_barrier<Scalar>(JetView<const Scalar>, double, double, JetView<Scalar>);             \
  template double probe_handles<Scalar>(JetView<const Scalar>, const HandleBatch<Scalar>&, double,           \
                                        JetView<Scalar>);                                                    \
  template double probe_stance<Scalar>(JetView<const Scalar>, ConstPointsRef<Scalar>, const Stance&, double, \
                                       JetView<Scalar>);
ARAPFIELDS_PROBES(float)
ARAPFIELDS_PROBES(double)

}  // namespace arapfields
