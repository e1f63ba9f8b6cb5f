// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>

#include "solve/solution.h"
#include "solve/trained/field_objective.h"

namespace arapfields {

/// Fills everything but `loop` and `warnings`. Energies and distortion are means and extremes over at most
/// `max_samples` of the samples, evenly spread in their order.
SolveReport measure(const DeformationField& field, const SurfaceSamples& samples, const ObjectiveTerms& terms,
                    Index max_samples = 4000);

/// A report, with its warnings, on a field that another solver made.
Solution measured(std::shared_ptr<DeformationField> field, const SurfaceSamples& samples,
                  const ObjectiveTerms& terms, LoopResult loop);

/// Puts another objective around the one that solve_field makes.
using WrapObjective = std::function<std::unique_ptr<Objective>(Objective& inner)>;

/// Runs the loop, measures the result, and turns Diverged into SolveDiverged.
Solution solve_field(std::shared_ptr<TrainableField> field, const SurfaceSamples& samples,
                     ObjectiveTerms terms, const LoopOptions& options, const Progress& progress,
                     const WrapObjective& wrap = {});

}  // namespace arapfields
