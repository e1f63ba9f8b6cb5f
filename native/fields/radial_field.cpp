// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/radial_field.h"

#include <algorithm>
#include <string>

#include "core/errors.h"
#include "core/parallel.h"
#include "distance/morton.h"
#include "fields/radial_evaluator.h"

namespace arapfields {
namespace {

/// Number of points above which spatial sorting pays off.
constexpr Index worth_sorting = 64;

}  // namespace

RadialField::RadialField(RadialBasis basis, RowMatrix<double> coefficients,
                         std::shared_ptr<const Influence> influence)
    : basis_(std::move(basis)), coefficients_(std::move(coefficients)), influence_(std::move(influence)) {
  require(basis_.radii.size() == basis_.center_count(), "radii",
          std::to_string(basis_.radii.size()) + " numbers",
          "one for each of the " + std::to_string(basis_.center_count()) + " centers is needed");
  require(
      coefficients_.rows() == basis_.size() && coefficients_.cols() == 3, "coefficients",
      "shape (" + std::to_string(coefficients_.rows()) + ", " + std::to_string(coefficients_.cols()) + ")",
      "shape (" + std::to_string(basis_.size()) + ", 3) is needed");
  require(basis_.centers.allFinite() && basis_.radii.allFinite() && coefficients_.allFinite() &&
              (basis_.radii.size() == 0 || basis_.radii.minCoeff() > 0.0),
          "radial field", "NaN, infinite numbers or radii that are not positive",
          "finite numbers are needed");
}

void RadialField::evaluate(PointsIn points, JetView<double> out) const { evaluate(points, out, nullptr); }

void RadialField::evaluate(PointsIn points, JetView<double> out,
                           const std::vector<SurfaceSide>* sides) const {
  if (points.rows() <= worth_sorting) {
    RadialEvaluator<double>(basis_, points, out.order, nullptr, sides).evaluate(coefficients_, out);
    if (influence_) influence_->confine(points, out);
    return;
  }
  const std::vector<std::uint32_t> order = morton_order(points);
  JetBlock<double> sorted(points.rows(), out.order);
  const Points near = points(order, Eigen::all);
  std::vector<SurfaceSide> near_sides;
  for (const std::uint32_t i : order)
    if (sides != nullptr) near_sides.push_back((*sides)[i]);
  RadialEvaluator<double>(basis_, near, out.order, nullptr, sides != nullptr ? &near_sides : nullptr)
      .evaluate(coefficients_, sorted.view());
  parallel_for(0, points.rows(), 1024, [&](Index first, Index last) {
    for (int c = 0; c < columns(out.order); ++c)
      for (Index i = first; i < last; ++i) std::copy_n(sorted.view().at(c, i), 3, out.at(c, order[i]));
  });
  if (influence_) influence_->confine(points, out);
}

Points RadialField::at(PointsIn mesh_points) const { return moved(mesh_points, nullptr); }

Points RadialField::at_vertices(const TriangleMesh& mesh) const {
  if (!basis_.embedding || !basis_.embedding->has_sides()) return at(mesh.vertices);
  const std::vector<SurfaceSide> sides = basis_.embedding->sides_of(mesh, frame());
  return moved(mesh.vertices, &sides);
}

Points RadialField::moved(PointsIn mesh_points, const std::vector<SurfaceSide>* sides) const {
  Points result(mesh_points.rows(), 3);
  evaluate(frame().to_cube(mesh_points), {result.data(), result.rows(), JetOrder::value}, sides);
  result = frame().to_mesh(result);
  if (!influence_) return result;
  const Vector influence = influence_->at(frame().to_cube(mesh_points));
  for (Index i = 0; i < result.rows(); ++i)  // conversion to the cube and back rounds
    if (influence[i] == 0.0) result.row(i) = mesh_points.row(i);
  return result;
}

bool RadialField::shares_places_with(const RadialField& other) const {
  return basis_.embedding == other.basis_.embedding && frame() == other.frame() &&
         influence_ == other.influence_ && basis_.center_count() == other.basis_.center_count() &&
         basis_.radii == other.basis_.radii && basis_.centers == other.basis_.centers;
}

}  // namespace arapfields
