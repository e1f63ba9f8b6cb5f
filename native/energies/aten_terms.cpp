// SPDX-License-Identifier: GPL-3.0-or-later
#include <ATen/ATen.h>

#include "energies/aten_energies.h"
#include "energies/stance.h"

namespace arapfields {
namespace {

constexpr double shortest = 1e-3;  // as in gauss_kernel.cpp

at::Tensor dots(const at::Tensor& a, const at::Tensor& b) { return (a * b).sum(-1, true); }

/// Columns of the cofactor matrix, (3, n, 3): minors_k = j_{k+1} × j_{k+2}.
at::Tensor minors_of(const at::Tensor& jets, const EnergyTables& tables) {
  return at::linalg_cross(at::index_select(jets, 0, tables.next_column),
                          at::index_select(jets, 0, tables.last));
}

/// What a style makes of unit normals (n,3): its loss (n,1), whose gradient is −factor · slope (n,3).
struct NormalLoss {
  at::Tensor loss, slope;
  double factor;
};

/// Mean of a loss of the deformed unit normals, and its cotangents.
template <class Loss>
at::Tensor of_normals(const at::Tensor& jets, const at::Tensor& normals, const at::Tensor& sample_weights,
                      double weight, const EnergyTables& tables, at::Tensor cotangents, const Loss& loss_of) {
  const double share = 1.0 / static_cast<double>(std::max<int64_t>(jets.size(1), 1));
  const at::Tensor minors = minors_of(jets, tables);
  const at::Tensor orientation = dots(jets[1], minors[0]);
  const at::Tensor sign = at::where(orientation < 0, -at::ones_like(orientation), at::ones_like(orientation));
  const at::Tensor columns = normals.t().unsqueeze(2);  // (3, n, 1)
  const at::Tensor image = sign * (columns * minors).sum(0);
  const at::Tensor length = at::sqrt(dots(image, image));
  const at::Tensor inverse = at::clamp_min(length, shortest).reciprocal();
  const at::Tensor unit = image * inverse;
  NormalLoss normal_loss = loss_of(unit);
  if (sample_weights.defined()) normal_loss.loss = normal_loss.loss * sample_weights.unsqueeze(1);
  if (cotangents.defined()) {
    const at::Tensor along =
        at::where(length > shortest, dots(unit, normal_loss.slope), at::zeros_like(length));
    at::Tensor h =
        (normal_loss.slope - along * unit) * sign * inverse * (-weight * share * normal_loss.factor);
    if (sample_weights.defined()) h = h * sample_weights.unsqueeze(1);
    // Of j_k: h × (n_{k+1} j_{k+2} − n_{k+2} j_{k+1}).
    const at::Tensor arms =
        at::index_select(columns, 0, tables.next_column - 1) * at::index_select(jets, 0, tables.last) -
        at::index_select(columns, 0, tables.last - 1) * at::index_select(jets, 0, tables.next_column);
    cotangents.slice(0, 1, 4).add_(at::linalg_cross(h.unsqueeze(0).expand_as(arms), arms));
  }
  return normal_loss.loss.sum() * share;
}

}  // namespace

at::Tensor aten_gauss(const at::Tensor& jets, const at::Tensor& normals, const at::Tensor& sample_weights,
                      const at::Tensor& preferred, double sharpness, double weight,
                      const EnergyTables& tables, at::Tensor cotangents) {
  const at::Tensor directions = preferred.slice(1, 0, 3);
  return of_normals(jets, normals, sample_weights, weight, tables, cotangents,
                    [&](const at::Tensor& unit) -> NormalLoss {
                      const at::Tensor terms = at::exp(sharpness * at::mm(unit, directions.t())) *
                                               preferred.select(1, 3).unsqueeze(0);  // (n, k)
                      return {1.0 - terms.sum(1, true), at::mm(terms, directions), sharpness};
                    });
}

at::Tensor aten_targets(const at::Tensor& jets, const at::Tensor& normals, const at::Tensor& sample_weights,
                        const at::Tensor& targets, double weight, const EnergyTables& tables,
                        at::Tensor cotangents) {
  return of_normals(jets, normals, sample_weights, weight, tables, cotangents,
                    [&](const at::Tensor& unit) -> NormalLoss {
                      const at::Tensor off = targets - unit;
                      return {dots(off, off), off, 2.0};
                    });
}

at::Tensor aten_barrier(const at::Tensor& jets, double threshold, double weight, const EnergyTables& tables,
                        at::Tensor cotangents) {
  const double share = 1.0 / static_cast<double>(std::max<int64_t>(jets.size(1), 1));
  const at::Tensor minors = minors_of(jets, tables);
  const at::Tensor gap = at::relu(1.0 - dots(jets[1], minors[0]) / threshold);  // (n, 1)
  if (cotangents.defined()) cotangents.slice(0, 1, 4).add_(gap * minors, -2.0 * weight * share / threshold);
  return (gap * gap).sum() * share;
}

at::Tensor aten_handles(const at::Tensor& jets, const at::Tensor& targets, const at::Tensor& weights,
                        double weight, at::Tensor cotangents) {
  const at::Tensor difference = jets[0] - targets, scaled = weights.unsqueeze(1) * difference;
  if (cotangents.defined()) cotangents[0].add_(scaled, 2.0 * weight);
  return (scaled * difference).sum();
}

at::Tensor aten_stance(const at::Tensor& jets, const at::Tensor& rest, const at::Tensor& up,
                       const at::Tensor& ground, double weight, at::Tensor cotangents) {
  const double share = 1.0 / static_cast<double>(std::max<int64_t>(jets.size(1), 1));
  const at::Tensor displacements = jets[0] - rest, touching = ground.unsqueeze(1);
  const at::Tensor others = displacements - displacements.mean(0, true),
                   rises = at::mm(displacements, up.unsqueeze(1));
  const at::Tensor uneven = rises - (touching * rises).sum() / at::clamp_min(ground.sum(), 1e-30);
  const at::Tensor lifted = touching * uneven;
  // Of the turn closest to the displacements, what is not about the upward axis; in float64, as the inertia
  // is inverted.
  const at::Tensor arms = (rest - rest.mean(0, true)).to(at::kDouble), upward = up.to(at::kDouble);
  const at::Tensor size = at::clamp_min((arms * arms).sum(), 1e-30);
  const at::Tensor inertia =
      (1.0 + Stance::thinnest) * size * at::eye(3, arms.options()) - at::mm(arms.t(), arms);
  const at::Tensor inverse = at::linalg_inv(inertia);
  const at::Tensor turn = at::mv(inverse, at::linalg_cross(arms, displacements.to(at::kDouble)).sum(0));
  const at::Tensor lean = turn - at::dot(turn, upward) * upward;
  const at::Tensor lean_torque = (Stance::lean_weight * size * at::mv(inverse, lean)).expand_as(arms);
  if (cotangents.defined())
    cotangents[0].add_(
        others + lifted * up.unsqueeze(0) + at::linalg_cross(lean_torque, arms).to(jets.scalar_type()),
        2.0 * weight * share);
  const at::Tensor leaning = Stance::lean_weight * size * at::dot(lean, lean);
  return ((others * others).sum() + (lifted * uneven).sum() + leaning.to(jets.scalar_type())) * share;
}

}  // namespace arapfields
