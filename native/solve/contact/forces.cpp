// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/contact/forces.h"

#include <algorithm>
#include <cmath>

#include "sampling/sample_choice.h"

namespace arapfields {
namespace {

using P = ContactParameters;

/// Indices of the planes with the most negative gaps, without near and parallel ones.
std::vector<Index> deepest_of(const Vector& gaps, const ContactSet& set) {
  std::vector<Index> order;
  for (Index i = 0; i < gaps.size(); ++i)
    if (gaps[i] < -P::projection_gap) order.push_back(i);
  std::sort(order.begin(), order.end(), [&](Index a, Index b) { return gaps[a] < gaps[b]; });
  std::vector<Index> chosen;
  for (const Index i : order) {
    const auto place = [&](Index k) { return set.places.row(set.planes[static_cast<std::size_t>(k)].first); };
    const bool free = std::none_of(chosen.begin(), chosen.end(), [&](Index k) {
      return (place(i) - place(k)).squaredNorm() < P::planes_apart * P::planes_apart &&
             set.planes[static_cast<std::size_t>(i)].normal.dot(
                 set.planes[static_cast<std::size_t>(k)].normal) > P::parallel_cosine;
    });
    if (free) chosen.push_back(i);
    if (std::ssize(chosen) == P::planes_in_a_round) break;
  }
  return chosen;
}

Vector gaps_of(const ContactSet& set, const Points& places) {
  Vector gaps(std::ssize(set.planes));
  for (Index i = 0; i < gaps.size(); ++i)
    gaps[i] = set.planes[static_cast<std::size_t>(i)].gap(places.data());
  return gaps;
}

}  // namespace

Points contact_places(RadialState& s) {
  const VectorF& u = s.measurements(s.fast);
  return s.fast.objective.latest()->contact_values(u).cast<double>();
}

void stiffen_contact(RadialState& s) {
  if (!s.contact.has_planes()) return;
  s.fast.objective.latest()->set_contact_stiffness(
      {s.problem.basis, s.contact.found(), contact_places(s), s.preconditioner.inverse_factor.latest()});
}

bool would_press(RadialState& s) {
  if (!s.contact.has_planes()) return false;
  const Points places = contact_places(s);
  return std::any_of(s.contact.found().planes.begin(), s.contact.found().planes.end(),
                     [&](const ContactPlane& p) {
                       return p.updated_pressure(p.gap(places.data()), s.contact.found().stiffness) > 0.0;
                     });
}

double update_pressures(RadialState& s) {
  if (!s.contact.has_planes()) return 0.0;
  return s.contact.update_pressures(contact_places(s).data(), Vector::Ones(s.contact.surface_count()));
}

bool is_deep(RadialState& s) {
  const Points places = contact_places(s);
  return std::any_of(s.contact.found().planes.begin(), s.contact.found().planes.end(),
                     [&](const ContactPlane& p) { return p.gap(places.data()) < -P::motion_depth; });
}

void update_balanced_pressures(RadialState& s) {
  if (!s.contact.has_planes()) return;
  const RadialObjective<float>& objective = *s.fast.objective.latest();
  const TallMatrix<float>& inverse_factor = s.preconditioner.inverse_factor.latest();
  const Points places = contact_places(s);
  // L⁻¹ times the gradient of all other terms, and of each surface's contact term.
  const auto half = [&](const RowMatrix<double>& gradient) {
    const PointsF result = inverse_factor.times(gradient.cast<float>());
    return Vector(Eigen::Map<const VectorF>(result.data(), result.size()).cast<double>());
  };
  Vector others = half(s.history.optimizer.latest().gradient());
  const Index count = s.contact.surface_count();
  RowMatrix<double> each = RowMatrix<double>::Zero(count, others.size());
  for (Index k = 0; k < count; ++k) {
    PointsF forces = PointsF::Zero(places.rows(), 3);
    for (const ContactPlane& plane : s.contact.found().planes) {
      if (plane.obstacle != k) continue;
      const double pressed = plane.updated_pressure(plane.gap(places.data()), s.contact.found().stiffness);
      const Eigen::RowVector3f force = (plane.area * pressed * plane.normal).transpose().cast<float>();
      forces.row(plane.first) += force;
      if (plane.second >= 0) forces.row(plane.second) -= force;
    }
    if (!forces.isZero(0.0f)) each.row(k) = half(objective.pull_back_contact(forces)).transpose();
    others += each.row(k).transpose();
  }
  const RowMatrix<double> products = each * each.transpose();
  const Vector answer = each * others;
  Vector shares = Vector::Zero(count);
  for (int sweep = 0; sweep < P::factor_sweeps; ++sweep)
    for (Index k = 0; k < count; ++k) {
      const double left = answer[k] - products.row(k).dot(shares) + products(k, k) * shares[k];
      shares[k] = products(k, k) > 0.0 ? std::clamp(left / products(k, k), 0.0, 1.0) : 0.0;
    }
  s.contact.update_pressures(places.data(), shares);
}

void push_out(RadialState& s) {
  if (!s.contact.has_planes()) return;
  const RadialObjective<float>& objective = *s.fast.objective.latest();
  const TallMatrix<float>& inverse_factor = s.preconditioner.inverse_factor.latest();
  const ContactSet& set = s.contact.found();
  VectorF u = s.measurements(s.fast);
  const Points before = objective.contact_values(u).cast<double>();
  const Vector gaps = gaps_of(set, before);
  const double longest = P::most_motion * -gaps.minCoeff();
  Vector left = gaps;
  ContactRows rows;
  std::vector<Index> taken;
  RowMatrix<double> step;
  for (int search = 0; search < P::projection_rounds; ++search) {
    const std::vector<Index> more = deepest_of(left, set);
    if (more.empty()) break;
    std::vector<const ContactPlane*> planes;
    RowMatrix<double> along(std::ssize(more), 3);
    for (const Index i : more) {
      planes.push_back(&set.planes[static_cast<std::size_t>(i)]);
      along.row(std::ssize(planes) - 1) = planes.back()->normal.transpose();
    }
    rows.add(s.problem.basis, set, planes, along, inverse_factor);
    taken.insert(taken.end(), more.begin(), more.end());
    const Vector forces = solve_complementarity(rows.compliance(), entries_of(gaps, taken));
    RowMatrix<double> next = inverse_factor.transpose_times(rows.pull(forces)).cast<double>();
    if (s.problem.mirror) s.problem.mirror->symmetrise(next);
    objective.measure_contact(s.shape.coefficients + next, u);
    const Points places = objective.contact_values(u).cast<double>();
    if ((places - before).rowwise().norm().maxCoeff() > longest) break;  // the planes are incompatible
    step = std::move(next);
    left = gaps_of(set, places);
  }
  if (step.size() == 0) return;
  s.shape.coefficients += step;
  ++s.shape.revision;
}

}  // namespace arapfields
