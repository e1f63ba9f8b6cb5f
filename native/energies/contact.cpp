// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/contact.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace arapfields {
namespace {

/// Least curvature of the quadratic model of the other terms, as a fraction of −slope.
constexpr double least_curvature = 0.1;
/// Most iterations of the safeguarded Newton method (bisection where it leaves the bracket).
constexpr int line_steps = 8;
/// Its tolerance on the step length.
constexpr double line_rest = 1e-9;

}  // namespace

template <class Scalar>
double contact_energy(const std::vector<ContactPlane>& planes, double stiffness, const Scalar* places,
                      Scalar* cotangents) {
  double energy = 0.0;
  for (const ContactPlane& plane : planes) {
    if (plane.friction > 0.0) {
      const Vec3 slip = plane.slip(places);
      const double length = slip.norm(), sliding = std::max(length, stuck);
      energy += plane.area * plane.friction *
                (length < stuck ? 0.5 * length * length / stuck : length - 0.5 * stuck);
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
  const double other_curvature = std::max(-slope - contact_curvature, least_curvature * -slope);
  double low = 0.0, high = 1.0, t = 1.0;
  for (int step = 0; step < line_steps; ++step) {
    const auto [first, second] = at(t);
    const double along = other_slope + t * other_curvature + first;
    if (t == 1.0 && along <= 0.0) return 1.0;
    (along > 0.0 ? high : low) = t;
    const double next = t - along / (other_curvature + second);
    if (std::abs(next - t) < line_rest) return std::min(next, 1.0);
    t = next > low - line_rest && next < high + line_rest ? std::clamp(next, low, high) : 0.5 * (low + high);
  }
  return t;
}

#define ARAPFIELDS_CONTACT(Scalar)                                                              \
  template double contact_step<Scalar>(const std::vector<ContactPlane>&, double, const Scalar*, \
                                       const Scalar*, double);                                  \
  template double contact_energy<Scalar>(const std::vector<ContactPlane>&, double, const Scalar*, Scalar*);
ARAPFIELDS_CONTACT(float)
ARAPFIELDS_CONTACT(double)

}  // namespace arapfields
