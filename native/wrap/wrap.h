// SPDX-License-Identifier: GPL-3.0-or-later
// One surface wrapped onto another.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/implicit.h"
#include "core/task.h"
#include "energies/arap.h"
#include "energies/distortion.h"
#include "fields/field.h"
#include "mesh/surface_samples.h"
#include "options/wrap.h"

namespace arapfields {

/// A point of the surface at rest and the corresponding point of the target, in mesh coordinates.
struct Landmark {
  Vec3 rest, target;
};

/// Distances, distortion and warnings of a wrap. Distances between surfaces are fractions of the diagonal of
/// the target's bounding box.
struct WrapReport {
  ArapValue arap;  ///< without the alignment's scale
  Distortion distortion;
  double to_target_mean = 0.0, to_target_95 = 0.0;      ///< from the wrapped surface to the target
  double from_target_mean = 0.0, from_target_95 = 0.0;  ///< from the target to the wrapped surface
  double matched_share = 1.0;     ///< fraction of the area that has a counterpart on an open target
  double diagonal = 0.0;          ///< in mesh units
  double scale = 1.0;             ///< of the alignment
  std::vector<double> landmarks;  ///< each one's distance to its target, in mesh units
  std::vector<Index> left_out;    ///< landmarks that contradict the others, by number from 0
  Index iterations = 0;
  double seconds = 0.0;
  std::vector<std::string> warnings;
};

struct WrapSolution {
  std::shared_ptr<DeformationField> field;
  WrapReport report;
};

/// Deforms a surface onto the zero set of a function, as rigidly as possible. First a similarity aligns it as
/// a whole; then it flows onto the target in stages of decreasing stiffness, driven by correspondences in
/// both directions and by landmarks. Each step is invertible, so that the surface does not pass through
/// itself. Parts without a counterpart on an open target follow their neighbours. The samples need normals;
/// their weights scale the stiffness. Throws InvalidInput that names bad options, samples, landmarks off
/// their surfaces or contradicting each other, a mirror image of them, and a target without a surface;
/// Cancelled.
ARAPFIELDS_EXPORT WrapSolution wrap(const SurfaceSamples& samples, const ImplicitFunction& target,
                                    const std::vector<Landmark>& landmarks, const WrapOptions& options,
                                    const Progress& progress = {});

}  // namespace arapfields
