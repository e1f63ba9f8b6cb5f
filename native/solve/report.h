// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <optional>

#include "energies/arap.h"
#include "energies/distortion.h"
#include "solve/field_objective.h"
#include "solve/training_loop.h"

namespace arapfields {

/// How well a solved field does what it was asked for, measured at surface samples after the solve.
/// Energies are those of the unit cube, lengths are in mesh units.
struct SolveReport {
  ArapValue arap;
  double energy = 0.0;                          ///< stretch + bending · bend
  std::vector<double> handle_mean, handle_max;  ///< distances ‖f(x) − C x‖ of each handle
  std::optional<double> preference;             ///< mean g of the deformed normals
  Distortion distortion;
  LoopResult loop;
  std::vector<std::string> notes;
};

struct Solution {
  std::shared_ptr<DeformationField> field;
  SolveReport report;
};

/// Diverged, with the last good state.
class SolveDiverged : public Diverged {
 public:
  SolveDiverged(const Diverged& cause, Solution last) : Diverged(cause), last_good(std::move(last)) {}
  Solution last_good;
};

/// Fills everything but `loop` and `notes`. Energies and distortion are means and extremes over at most
/// `max_samples` of the samples, evenly spread in their order.
SolveReport measure(const DeformationField& field, const SurfaceSamples& samples, const ObjectiveTerms& terms,
                    Index max_samples = 4000);

/// A report on a field that another solver made.
Solution measured(std::shared_ptr<DeformationField> field, const SurfaceSamples& samples,
                  const ObjectiveTerms& terms, LoopResult loop);

/// Puts another objective around the one that solve_field makes.
using WrapObjective = std::function<std::unique_ptr<Objective>(Objective& inner)>;

/// Runs the loop, measures the result, and turns Diverged into SolveDiverged.
Solution solve_field(std::shared_ptr<TrainableField> field, const SurfaceSamples& samples,
                     ObjectiveTerms terms, const LoopOptions& options, const Progress& progress,
                     const WrapObjective& wrap = {});

}  // namespace arapfields
