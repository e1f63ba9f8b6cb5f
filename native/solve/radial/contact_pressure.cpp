// SPDX-License-Identifier: GPL-3.0-or-later
// The contact planes' pressures: augmented-Lagrangian multipliers per unit of area.
#include <algorithm>
#include <cmath>

#include "solve/radial/contact_terms.h"

namespace arapfields {
namespace {

/// Penetration depths are clamped to this, in cube units, in multiplier updates: early iterates penetrate by
/// more than their forces warrant.
constexpr double deepest_counted = 0.01;
/// Factors of the stiffness where depths do not decrease and where they do, and its maximum.
constexpr double harder = 4.0, hardest = 3e6, softer = 0.25;
/// Gap, in cube units, at which the mean pressure vanishes at most: the multiplier of a softer plane would
/// hold off points farther away that have left it.
constexpr double hover = 2e-3;
/// Softening length of forces_at()'s weights, in cube units.
constexpr double handle_reach = 0.2;

/// Weight 1/(d² + handle_reach²) of a force at a row of `places` (n,3), at the distance d; 0 for row −1.
double nearness(const double* places, Index row, const Vec3& place) {
  if (row < 0) return 0.0;
  const double square = (Eigen::Map<const Vec3>(places + 3 * row) - place).squaredNorm();
  return 1.0 / (square + handle_reach * handle_reach);
}

}  // namespace

/// Replaces the planes. Collects their points, once each, and lets the planes index them.
void ContactTerms::set_planes(std::vector<ContactPlane> planes) {
  std::vector<Index> place(static_cast<std::size_t>(points_.size()), -1);
  const auto of = [&](Index row) -> Index& { return place[static_cast<std::size_t>(row)]; };
  for (const ContactPlane& plane : planes)
    for (const Index row : {plane.first, plane.second})
      if (row >= 0) of(row) = 0;
  std::vector<Index> rows;
  for (Index row = 0; row < points_.size(); ++row) {
    if (of(row) < 0) continue;
    of(row) = std::ssize(rows);
    rows.push_back(row);
  }
  found_.places = points_.rest(rows);
  found_.embedded = points_.embedded(rows);
  for (ContactPlane& plane : planes) {
    plane.first = of(plane.first);
    if (plane.second >= 0) plane.second = of(plane.second);
  }
  found_.rows = std::move(rows);
  found_.planes = std::move(planes);
  found_.revision = found_.planes.empty() ? 0 : ++sets_;
  has_friction_ = false;
}

Index ContactTerms::sample_of(Index place) const {
  const Index row = found_.rows[static_cast<std::size_t>(place)];
  return points_.samples()[static_cast<std::size_t>(points_.sample_of(row))];
}

double ContactSet::contact_area() const {
  double share = 0.0;
  for (const ContactPlane& plane : planes)
    if (plane.pressure > 0.0) share += plane.area;
  return share;
}

std::string ContactTerms::name_of(Index surface) const {
  if (contact_ && surface < std::ssize(contact_->obstacles))
    return "obstacles[" + std::to_string(surface) + "]";
  return surface < std::ssize(surfaces_) ? "ground" : "itself";
}

Points ContactSet::forces_at(const Vec3& place, const double* now, Index surfaces) const {
  Points forces = Points::Zero(surfaces, 3);
  for (const ContactPlane& plane : planes) {
    const double share = nearness(now, plane.first, place) - nearness(now, plane.second, place);
    forces.row(plane.obstacle) += share * plane.area * plane.pressure * plane.normal.transpose();
  }
  return forces;
}

double ContactTerms::update_pressures(const double* places, const Vector& factors) {
  double change = 0.0, most = 0.0;
  for (ContactPlane& plane : found_.planes) {
    const double before = plane.pressure;
    const double gap = std::max(-deepest_counted, plane.gap(places));
    plane.pressure = factors[plane.obstacle] * plane.updated_pressure(gap, found_.stiffness);
    history_->pressures(found_.rows[static_cast<std::size_t>(plane.first)], plane.obstacle) = plane.pressure;
    change += plane.area * std::abs(plane.pressure - before);
    most += plane.area * std::max(plane.pressure, before);
  }
  if (has_friction_) add_friction();
  return most > 0.0 ? change / most : 0.0;
}

void ContactTerms::add_friction() {
  has_friction_ = true;
  const double coefficient = contact_ ? contact_->friction : Contact().friction;
  for (ContactPlane& plane : found_.planes)
    if (plane.second < 0) plane.friction = coefficient * plane.pressure;
}

void ContactSet::adapt_stiffness(bool raise) {
  double sum = 0.0, share = 0.0;
  for (const ContactPlane& plane : planes) {
    sum += plane.area * plane.pressure;
    if (plane.pressure > 0.0) share += plane.area;
  }
  const double fitting = share > 0.0 ? sum / share / hover : 0.0;
  const double wanted = std::max({softest, fitting, (raise ? harder : softer) * stiffness});
  stiffness = std::min(wanted, hardest);
}

}  // namespace arapfields
