// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/composed_field.h"

#include <algorithm>
#include <array>
#include <string>

#include "core/errors.h"
#include "core/parallel.h"
#include "distance/morton.h"
#include "fields/radial_evaluator.h"

namespace arapfields {
namespace {

/// Points whose jets are carried through all maps at a time.
constexpr Index points_at_once = 16384;

void compose_at(const JetView<const double>& outer, const JetView<double>& inner, Index i) {
  Mat3 inner_jacobian, outer_jacobian;  // ∂f and ∂g
  for (int k = 0; k < 3; ++k) {
    inner_jacobian.col(k) = Eigen::Map<const Vec3>(inner.at(first_column(k), i));
    outer_jacobian.col(k) = Eigen::Map<const Vec3>(outer.at(first_column(k), i));
  }
  if (inner.order == JetOrder::second) {
    std::array<Vec3, 6> second;
    for (int j = 0; j < 3; ++j)
      for (int k = j; k < 3; ++k) {
        Vec3& sum = second[second_column(j, k) - 4];
        sum = outer_jacobian * Eigen::Map<const Vec3>(inner.at(second_column(j, k), i));
        for (int l = 0; l < 3; ++l)
          for (int m = 0; m < 3; ++m)
            sum += inner_jacobian(l, j) * inner_jacobian(m, k) *
                   Eigen::Map<const Vec3>(outer.at(second_column(l, m), i));
      }
    for (int c = 4; c < 10; ++c) Eigen::Map<Vec3>(inner.at(c, i)) = second[c - 4];
  }
  for (int k = 0; k < 3; ++k)
    Eigen::Map<Vec3>(inner.at(first_column(k), i)) = outer_jacobian * inner_jacobian.col(k);
}

JetBlock<double> identity_jets(PointsIn points, JetOrder order) {
  JetBlock<double> jets(points.rows(), order);
  for (Index i = 0; i < points.rows(); ++i) {
    Eigen::Map<Vec3>(jets.view().at(0, i)) = points.row(i);
    for (int k = 0; k < 3 && order != JetOrder::value; ++k) jets.view().at(first_column(k), i)[k] = 1.0;
  }
  return jets;
}

}  // namespace

void compose(JetView<const double> outer, JetView<double> inner) {
  require(outer.count == inner.count && outer.order == inner.order, "jets",
          "two sets of different count or order", "the same are needed");
  if (inner.order != JetOrder::value)
    parallel_for(0, inner.count, 512, [&](Index first, Index last) {
      for (Index i = first; i < last; ++i) compose_at(outer, inner, i);
    });
  std::copy_n(outer.data, 3 * inner.count, inner.data);
}

ComposedField::ComposedField(std::vector<FieldStep> steps) : steps_(std::move(steps)) {
  for (const FieldStep& step : steps_) {
    require(step.map != nullptr, "steps", "one without a map", "each needs one");
    require(step.repeats >= 1, "steps", std::to_string(step.repeats) + " repeats", "at least one is needed");
  }
}

void ComposedField::evaluate(PointsIn points, JetView<double> out) const {
  const std::vector<std::uint32_t> order = morton_order(points);
  const Index all = points.rows();
  for (Index first = 0; first < all; first += points_at_once) {
    const Index count = std::min(points_at_once, all - first);
    Points chunk(count, 3);
    for (Index i = 0; i < count; ++i) chunk.row(i) = points.row(order[first + i]);
    JetBlock<double> jets = identity_jets(chunk, out.order);
    JetBlock<double> outer(count, out.order);
    for (const FieldStep& step : steps_)
      for (int k = 0; k < step.repeats; ++k) {
        const Eigen::Map<const Points> places(jets.view().data, count, 3);
        RadialEvaluator<double>(step.map->basis(), places, out.order)
            .evaluate(step.map->coefficients(), outer.view());
        compose(std::as_const(outer).view(), jets.view());
      }
    for (int c = 0; c < columns(out.order); ++c)
      for (Index i = 0; i < count; ++i) std::copy_n(jets.view().at(c, i), 3, out.at(c, order[first + i]));
  }
}

}  // namespace arapfields
