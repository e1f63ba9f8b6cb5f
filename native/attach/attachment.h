// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/task.h"
#include "fields/field.h"
#include "mesh/surface_samples.h"

namespace arapfields {

/// Points carried along by a body, such as clothes, hair or hats, that its samples do not contain. Within
/// 0.03 of the body's size of its surface they move with the field. Beyond 0.06 they move with rigid frames
/// of the surface: f(p) + R(p) (y − p) for a point p of the surface, R the rotation closest to the Jacobian.
/// Between the two distances both are mixed. Where a radial field is steep off the surface, as under a
/// style, both shrink to a third. Several frames blend at each point, with weights that vary smoothly, so
/// that nothing tears where the nearest frame changes. Everything that does not depend on the field is
/// computed once. With a field other than a radial one, such as that of a wrap, distances from the surface
/// grow as the root of its area does.
class ARAPFIELDS_EXPORT Attachment {
 public:
  /// Samples of the body at rest and points (n,3) of mesh coordinates at rest. Throws InvalidInput for no
  /// samples and for numbers that are not finite.
  Attachment(const SurfaceSamples& samples, PointsIn points, const Progress& progress = {});
  ~Attachment();
  Attachment(Attachment&&) noexcept;

  /// The points (n,3) moved by the field, in mesh coordinates. Thread-safe. Radial fields of one basis, such
  /// as those of a live session, are evaluated several times faster from the second one on.
  Points positions(const DeformationField& field) const;
  Index size() const;
  /// (n) from each point to the nearest sample, mesh units.
  const Vector& distances() const;

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace arapfields
