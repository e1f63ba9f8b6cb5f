// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "solve/mesh_measures.h"
#include "solve/solution.h"
#include "solve/trained/objective.h"

namespace arapfields {

/// Measures all of a report but `loop` and `warnings`. Energies and distortion are means and extremes over at
/// most `max_samples` of the samples, evenly spaced in their order.
SolveReport measure(const DeformationField& field, const SurfaceSamples& samples, const ObjectiveTerms& terms,
                    Index max_samples = 4000);

/// A field that another solver made, with its report and warnings. `of_mesh`: measure_triangles() of the
/// samples' mesh, where they are known.
Solution measured(std::shared_ptr<DeformationField> field, const SurfaceSamples& samples,
                  const ObjectiveTerms& terms, LoopResult loop, std::optional<MeshMeasures> of_mesh = {});

/// Makes the objective to minimise out of solve_field's own, for terms that it does not know.
using WrapObjective = std::function<std::unique_ptr<Objective>(Objective& inner)>;

/// Runs the loop, measures the result, and turns Diverged into SolveDiverged.
Solution solve_field(std::shared_ptr<TrainableField> field, const SurfaceSamples& samples,
                     ObjectiveTerms terms, const LoopOptions& options, const Progress& progress,
                     const WrapObjective& wrap = {});

}  // namespace arapfields
