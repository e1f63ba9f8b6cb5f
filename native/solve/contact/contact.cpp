// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/contact/contact.h"

#include <cmath>

#include "core/errors.h"
#include "solve/contact/parameters.h"

namespace arapfields {
namespace {

using P = ContactParameters;

}  // namespace

void require_contact(const Contact& contact) {
  for (std::size_t i = 0; i < contact.obstacles.size(); ++i) {
    const std::string name = "obstacles[" + std::to_string(i) + "]";
    require(contact.obstacles[i].function != nullptr, name, "no function", "an implicit function is needed");
    require_range(name + ".margin", contact.obstacles[i].margin, 0.0, P::farthest_length);
  }
  for (std::size_t i = 0; i < contact.obstacles.size(); ++i) {
    const Mat4& place = contact.obstacles[i].placement;
    const Mat3 linear = place.topLeftCorner<3, 3>();
    const double size = std::cbrt(linear.determinant());
    require(place.allFinite() && place.row(3) == Eigen::RowVector4d(0, 0, 0, 1) && size > 0.0 &&
                (linear.transpose() * linear - size * size * Mat3::Identity()).norm() <
                    P::scale_error * size * size,
            "obstacles[" + std::to_string(i) + "].placement", "no turn, shift and even scale",
            "a (4, 4) matrix of these alone is needed");
    require(place.cwiseAbs().maxCoeff() <= P::farthest_length,
            "obstacles[" + std::to_string(i) + "].placement",
            number_text(place.cwiseAbs().maxCoeff()) + " in it",
            "numbers of at most " + number_text(P::farthest_length) + " are allowed");
  }
  require_not_negative("friction", contact.friction);
  require(!contact.ground || std::isfinite(*contact.ground), "ground", "NaN or infinite",
          "a finite height is needed");
  if (contact.ground) require_range("ground", *contact.ground, -P::farthest_length, P::farthest_length);
  const double length = contact.up.stableNorm();
  require(std::isfinite(length) && length > 0.0, "up", length == 0.0 ? "zero" : "NaN or infinite",
          "a finite direction of any positive length is allowed");
}

std::vector<std::string> notes_on(const ContactReport& report) {
  std::vector<std::string> notes;
  for (const HeldBack& held : report.held)
    notes.push_back("handles[" + std::to_string(held.handle) + "] is held back by " + held.by + ", " +
                    number_text(held.distance) + " from its target");
  for (const std::string& name : report.crossing)
    notes.push_back(name + " crosses the surface; what lies inside of it stays there");
  if (const Index pairs = report.self_intersections.value_or(0); pairs > 0) {
    const Vec3& at = report.intersection;
    notes.push_back("parts of the shape pass through each other, at (" + number_text(at[0]) + ", " +
                    number_text(at[1]) + ", " + number_text(at[2]) + "): " + std::to_string(pairs) +
                    (pairs == 1 ? " pair" : " pairs") + " of triangles");
  }
  return notes;
}

}  // namespace arapfields
