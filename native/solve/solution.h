// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/errors.h"
#include "energies/arap.h"
#include "energies/distortion.h"
#include "fields/field.h"
#include "optimize/iteration.h"
#include "solve/contact/contact.h"

namespace arapfields {

/// Energies and errors of a solved field, measured at surface samples after the solve.
/// The stretch and the energy are pure numbers, the bend is in 1/cube units², lengths are in mesh units.
struct SolveReport {
  ArapValue arap;                   ///< arap.energy with the samples' own stiffness
  std::vector<LossTerm> terms;      ///< the weighted terms of the last iteration, at its samples
  std::vector<double> handle_mean;  ///< distance ‖f(x) − C x‖, of each handle
  std::vector<double> handle_max;
  std::optional<double> far_target;  ///< FarTarget::sizes (solve/warnings.h); none: no target is far
  std::optional<double> preference;  ///< mean g(ñ) of the deformed normals, or mean ñ·T(n) (object's style)
  Distortion distortion;
  ContactReport contact;
  /// Triangles of the mesh that turn over where the field does not fold: they are too long for the motion;
  /// 0 where they are too few to tell of.
  Index turned_triangles = 0;
  LoopResult loop;
  std::vector<std::string> warnings;  ///< sentences: folds, far targets, margins that were reduced
};

struct Solution {
  std::shared_ptr<DeformationField> field;
  SolveReport report;
};

/// Diverged, with the field of the last finite state.
class ARAPFIELDS_EXPORT SolveDiverged : public Diverged {
 public:
  SolveDiverged(const Diverged& cause, Solution last) : Diverged(cause), last_good(std::move(last)) {}
  Solution last_good;
};

}  // namespace arapfields
