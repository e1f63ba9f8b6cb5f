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

/// Solves f(x) = y by Newton's method with the field's own Jacobian, its steps halved until the residual
/// falls. It starts from that of `rest` whose image is nearest to y, and where that fails from the nearest
/// image of a grid over [-1,1]³, then from y itself; at last along straight lines from the images of these
/// starts to y. Where f folds space there are several x: the start then decides. Where the field knows its
/// inverse in closed form, it is asked instead, for whatever lies however far. Built once for many calls; the
/// field must outlive it.
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
