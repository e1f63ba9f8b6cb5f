// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/task.h"
#include "fields/field.h"
#include "options/newton.h"

namespace arapfields {

struct InverseResult {
  Points points;  ///< (n,3); NaN where nothing was found
  Index failures = 0;
  double worst_residual = 0.0;  ///< over the points found; 0 where the inverse has a closed form
};

/// f at points (n,3) in cube coordinates, in pieces between which `progress` may cancel.
ARAPFIELDS_EXPORT Points values_at(const DeformationField& field, PointsIn points, const Progress& progress);

/// Solves f(x) = y by damped Newton iterations with the field's Jacobian. The start is the point of `rest`
/// with the image nearest to y; if that fails, the grid point of [-1,1]³ with the nearest image, then y
/// itself; then continuation along straight lines from the images of these starts to y. Where f folds space
/// there are several solutions, and the start decides. A field's closed-form inverse is used instead if there
/// is one, at any distance. Built once for many calls; the field must outlive it.
class ARAPFIELDS_EXPORT NewtonInverse {
 public:
  NewtonInverse(const DeformationField& field, Points rest, const Progress& progress = {});
  ~NewtonInverse();
  NewtonInverse(NewtonInverse&&) noexcept;

  /// x for every row y of `targets`, all in cube coordinates.
  InverseResult operator()(PointsIn targets, const NewtonInverseOptions& options = {},
                           const Progress& progress = {}) const;

 private:
  struct Parts;
  std::unique_ptr<const Parts> parts_;
};

/// The same for one use, from the field's rest points.
ARAPFIELDS_EXPORT InverseResult invert(const DeformationField& field, PointsIn targets,
                                       const NewtonInverseOptions& options = {},
                                       const Progress& progress = {});

}  // namespace arapfields
