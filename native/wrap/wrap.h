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

/// A place on the surface at rest and the place of the target that it belongs to, in mesh coordinates.
struct Landmark {
  Vec3 rest, target;
};

/// What a wrap reached. Distances between surfaces are shares of the diagonal of the target's bounding box.
struct WrapReport {
  ArapValue arap;  ///< beside the alignment's scale
  Distortion distortion;
  double to_target_mean = 0.0, to_target_95 = 0.0;      ///< from the wrapped surface to the target
  double from_target_mean = 0.0, from_target_95 = 0.0;  ///< from the target to the wrapped surface
  double matched_share = 1.0;     ///< of the surface: what has a counterpart on an open target
  double diagonal = 0.0;          ///< in mesh units
  double scale = 1.0;             ///< by which the surface as a whole has grown
  std::vector<double> landmarks;  ///< each one's distance to its target, in mesh units
  Index iterations = 0;
  double seconds = 0.0;
  std::vector<std::string> notes;
};

struct WrapSolution {
  std::shared_ptr<DeformationField> field;
  WrapReport report;
};

/// Deforms a surface onto the zero set of a function, as rigidly as possible: moves, turns and scales it as a
/// whole, then lets it flow there in stages of decreasing rigidity, drawn by the nearest places with like
/// normals on both sides and by landmarks. It does not pass through itself: each step can be undone. What has
/// no counterpart on an open target is only carried along. The samples need normals; their weights say what
/// resists more. Throws InvalidInput that names bad options, samples, landmarks far off their surfaces or
/// contradicting each other, and a target without a surface; Cancelled.
ARAPFIELDS_EXPORT WrapSolution wrap(const SurfaceSamples& samples, const ImplicitFunction& target,
                                    const std::vector<Landmark>& landmarks, const WrapOptions& options,
                                    const Progress& progress = {});

}  // namespace arapfields
