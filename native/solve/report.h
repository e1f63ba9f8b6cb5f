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

/// What is known of a field: measure() of it, and measure_triangles() of the samples' mesh.
struct Measures {
  std::optional<SolveReport> at_samples;
  std::optional<MeshMeasures> of_mesh;
};

/// A field that another solver made, with its report and warnings. What is not known of it is measured.
Solution measured(std::shared_ptr<DeformationField> field, const SurfaceSamples& samples,
                  const ObjectiveTerms& terms, LoopResult loop, Measures known = {});

/// Makes the objective to minimise out of solve_field's own, for terms that it does not know.
using WrapObjective = std::function<std::unique_ptr<Objective>(Objective& inner)>;

/// Runs the loop, measures the result, and turns Diverged into SolveDiverged.
Solution solve_field(std::shared_ptr<TrainableField> field, const SurfaceSamples& samples,
                     ObjectiveTerms terms, const LoopOptions& options, const Progress& progress,
                     const WrapObjective& wrap = {});

}  // namespace arapfields
