// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/task.h"
#include "fields/field.h"
#include "mesh/surface_samples.h"

namespace arapfields {

/// Points that a field carries along with a body: clothes, hair, hats, whatever its motion does not see.
/// Near the body, within 0.03 of its size, they go where the field takes them. A field knows less and less of
/// what is farther away: beyond 0.06 they go along with rigid frames of the surface, the nearest ones most
/// (f(p) + R(p) (y − p) for places p of the surface, R the rotation closest to the Jacobian), between the two
/// with a mixture. Several frames share a point, with weights that change smoothly from point to point, so
/// that nothing tears where its nearest place jumps. All that does not depend on the field is found once.
class ARAPFIELDS_EXPORT Attachment {
 public:
  /// Samples of the body at rest and points (n,3) of mesh coordinates at rest. Throws InvalidInput for no
  /// samples and for numbers that are not finite.
  Attachment(const SurfaceSamples& samples, PointsIn points, const Progress& progress = {});
  ~Attachment();
  Attachment(Attachment&&) noexcept;

  /// Where the field takes the points: (n,3) in mesh coordinates. From any number of threads at a time.
  /// Radial fields of one basis, as a live session makes them, are evaluated several times faster from the
  /// second on.
  Points positions(const DeformationField& field) const;
  Index size() const;
  /// (n) from each point to the nearest sample, mesh units.
  const Vector& distances() const;

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace arapfields
