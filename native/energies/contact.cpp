// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/contact.h"

#include <algorithm>

namespace arapfields {

template <class Scalar>
double contact_energy(const std::vector<ContactPlane>& planes, double stiffness, const Scalar* places,
                      Scalar* cotangents) {
  double energy = 0.0;
  for (const ContactPlane& plane : planes) {
    if (plane.grip > 0.0) {
      const Vec3 slip = plane.slip(places);
      const double way = slip.norm(), sliding = std::max(way, stuck);
      energy += plane.share * plane.grip * (way < stuck ? 0.5 * way * way / stuck : way - 0.5 * stuck);
      if (cotangents != nullptr)
        for (int k = 0; k < 3; ++k)
          cotangents[3 * plane.first + k] +=
              static_cast<Scalar>(plane.share * plane.grip * slip[k] / sliding);
    }
    const double pressed = plane.pressed(plane.gap(places), stiffness);
    energy += plane.share * (pressed * pressed - plane.pressure * plane.pressure) / (2.0 * stiffness);
    if (cotangents == nullptr || pressed == 0.0) continue;
    for (int k = 0; k < 3; ++k) {
      const auto force = static_cast<Scalar>(plane.share * pressed * plane.normal[k]);
      cotangents[3 * plane.first + k] -= force;
      if (plane.second >= 0) cotangents[3 * plane.second + k] += force;
    }
  }
  return energy;
}

#define ARAPFIELDS_CONTACT(Scalar) \
  template double contact_energy<Scalar>(const std::vector<ContactPlane>&, double, const Scalar*, Scalar*);
ARAPFIELDS_CONTACT(float)
ARAPFIELDS_CONTACT(double)

}  // namespace arapfields
