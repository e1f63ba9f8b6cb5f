// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/composed_energies.h"
#include "energies/stance.h"
#include "tensors/operations.h"

namespace arapfields {
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

}  // namespace arapfields
