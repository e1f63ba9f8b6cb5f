// SPDX-License-Identifier: GPL-3.0-or-later
// How a live solver takes another field's shape.
#include "core/parallel.h"
#include "sampling/sample_choice.h"
#include "solve/radial/state.h"

namespace arapfields {

/// The projection in the surrogate's norm, by conjugate gradients, since the preconditioner knows a part of
/// the samples. What single precision leaves of far coefficients grows with each round: the round of least
/// energy is the start.
void RadialSolver::State::adopt(const DeformationField& field) {
  constexpr int rounds = 8;
  const ThreadScope threads(options_.threads);
  precondition(0.0);
  const RadialObjective<float>& objective = *fast_.objective;
  const Points places = rows_of(surface_, chosen_);
  // Fields of another frame: the reflections' plane may have moved it.
  const Frame& from = field.frame();
  const auto there = [&](PointsIn points) {
    return from == frame_ ? Points(points) : from.to_cube(frame_.to_mesh(points));
  };
  const auto here = [&](PointsIn points) {
    return from == frame_ ? Points(points) : frame_.to_cube(from.to_mesh(points));
  };
  JetBlock<double> jets(places.rows(), JetOrder::second);
  field.evaluate(there(places), jets.view());
  Eigen::Map<Points> values(jets.view().data, places.rows(), 3);
  values = here(values);
  Eigen::Map<Vector>(jets.view().column(4), 18 * places.rows()) *= frame_.scale / from.scale;
  Points ends(pairs_.sources.rows(), 3);
  field.evaluate(there(pairs_.sources), {ends.data(), ends.rows(), JetOrder::value});
  ends = here(ends);
  VectorF wanted = VectorF::Zero(30 * places.rows() + 3 * ends.rows() + 3 * basis_.center_count());
  if (blend_) RadialBlend<double>(*blend_, places).multiply(jets.view());
  wanted.head(30 * places.rows()) =
      Eigen::Map<const Vector>(jets.view().data, 30 * places.rows()).cast<float>();
  wanted.segment(30 * places.rows(), 3 * ends.rows()) =
      Eigen::Map<const Vector>(ends.data(), 3 * ends.rows()).cast<float>();
  const auto dot = [](const auto& a, const auto& b) { return a.cwiseProduct(b).sum(); };
  VectorF u, du;
  objective.measure(coefficients_, u);
  double value = objective.value(u, nullptr);
  RowMatrix<double> residual = objective.pull_back(objective.weighted(wanted - u));
  RowMatrix<double> image = objective.precondition(residual), direction = image;
  double square = dot(residual, image);
  for (int round = 0; round < rounds && square > 0.0; ++round) {
    objective.measure(direction, du);
    const RowMatrix<double> product = objective.pull_back(objective.weighted(du));
    const double step = square / dot(direction, product);
    u += static_cast<float>(step) * du;
    const double next_value = objective.value(u, nullptr);
    if (!(next_value < value)) break;
    value = next_value;
    coefficients_ += step * direction;
    residual -= step * product;
    image = objective.precondition(residual);
    const double next = dot(residual, image);
    direction = image + next / square * direction;
    square = next;
  }
  forget_past();
  rest();
}

}  // namespace arapfields
