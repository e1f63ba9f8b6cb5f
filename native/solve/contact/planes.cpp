// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/contact/planes.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace arapfields {
namespace {

using P = ContactParameters;

/// Weight 1/(d² + handle_reach²) of a force at a row of `places` (n,3), at the distance d; 0 for row −1.
double nearness(const double* places, Index row, const Vec3& place) {
  if (row < 0) return 0.0;
  const double square = (Eigen::Map<const Vec3>(places + 3 * row) - place).squaredNorm();
  return 1.0 / (square + P::force_reach * P::force_reach);
}

}  // namespace

template <class Scalar>
double contact_energy(const std::vector<ContactPlane>& planes, double stiffness, const Scalar* places,
                      Scalar* cotangents) {
  double energy = 0.0;
  for (const ContactPlane& plane : planes) {
    if (plane.friction > 0.0) {
      const Vec3 slip = plane.slip(places);
      const double length = slip.norm(), sliding = std::max(length, P::stuck);
      energy += plane.area * plane.friction *
                (length < P::stuck ? 0.5 * length * length / P::stuck : length - 0.5 * P::stuck);
      if (cotangents != nullptr)
        for (int k = 0; k < 3; ++k)
          cotangents[3 * plane.first + k] +=
              static_cast<Scalar>(plane.area * plane.friction * slip[k] / sliding);
    }
    const double pressed = plane.updated_pressure(plane.gap(places), stiffness);
    energy += plane.area * (pressed * pressed - plane.pressure * plane.pressure) / (2.0 * stiffness);
    if (cotangents == nullptr || pressed == 0.0) continue;
    for (int k = 0; k < 3; ++k) {
      const auto force = static_cast<Scalar>(plane.area * pressed * plane.normal[k]);
      cotangents[3 * plane.first + k] -= force;
      if (plane.second >= 0) cotangents[3 * plane.second + k] += force;
    }
  }
  return energy;
}

template <class Scalar>
double contact_step(const std::vector<ContactPlane>& planes, double stiffness, const Scalar* places,
                    const Scalar* displacements, double slope) {
  struct Meeting {
    double pressed;  // pressure − stiffness·gap
    double rate;     // its derivative along the step
    double area;
  };
  std::vector<Meeting> meetings;
  for (const ContactPlane& plane : planes) {
    if (plane.friction > 0.0) return 1.0;
    const double pressed = plane.pressure - stiffness * plane.gap(places);
    const double rate = -stiffness * (plane.gap(displacements) + plane.offset);
    if (pressed > 0.0 || pressed + rate > 0.0) meetings.push_back({pressed, rate, plane.area});
  }
  const auto at = [&](double t) {  // first and second derivative of the planes' energy at t
    double first = 0.0, second = 0.0;
    for (const Meeting& m : meetings) {
      const double pressed = m.pressed + t * m.rate;
      if (pressed <= 0.0) continue;
      first += m.area * pressed * m.rate / stiffness;
      second += m.area * m.rate * m.rate / stiffness;
    }
    return std::pair(first, second);
  };
  const auto [contact_slope, contact_curvature] = at(0.0);
  const double other_slope = slope - contact_slope;
  const double other_curvature = std::max(-slope - contact_curvature, P::least_curvature * -slope);
  double low = 0.0, high = 1.0, t = 1.0;
  for (int step = 0; step < P::line_iterations; ++step) {
    const auto [first, second] = at(t);
    const double along = other_slope + t * other_curvature + first;
    if (t == 1.0 && along <= 0.0) return 1.0;
    (along > 0.0 ? high : low) = t;
    const double next = t - along / (other_curvature + second);
    if (std::abs(next - t) < P::line_tolerance) return std::min(next, 1.0);
    t = next > low - P::line_tolerance && next < high + P::line_tolerance ? std::clamp(next, low, high)
                                                                          : 0.5 * (low + high);
  }
  return t;
}

#define ARAPFIELDS_CONTACT(Scalar)                                                              \
  template double contact_step<Scalar>(const std::vector<ContactPlane>&, double, const Scalar*, \
                                       const Scalar*, double);                                  \
  template double contact_energy<Scalar>(const std::vector<ContactPlane>&, double, const Scalar*, Scalar*);
ARAPFIELDS_CONTACT(float)
ARAPFIELDS_CONTACT(double)

double ContactSet::contact_area() const {
  double share = 0.0;
  for (const ContactPlane& plane : planes)
    if (plane.pressure > 0.0) share += plane.area;
  return share;
}

Points ContactSet::forces_at(const Vec3& place, const double* now, Index surfaces) const {
  Points forces = Points::Zero(surfaces, 3);
  for (const ContactPlane& plane : planes) {
    const double share = nearness(now, plane.first, place) - nearness(now, plane.second, place);
    forces.row(plane.obstacle) += share * plane.area * plane.pressure * plane.normal.transpose();
  }
  return forces;
}

void ContactSet::adapt_stiffness(bool raise) {
  double sum = 0.0, share = 0.0;
  for (const ContactPlane& plane : planes) {
    sum += plane.area * plane.pressure;
    if (plane.pressure > 0.0) share += plane.area;
  }
  const double fitting = share > 0.0 ? sum / share / P::hover : 0.0;
  const double wanted = std::max({P::softest, fitting, (raise ? P::stiffer : P::softer) * stiffness});
  stiffness = std::min(wanted, P::stiffest);
}

}  // namespace arapfields
