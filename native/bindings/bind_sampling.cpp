// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/python_function.h"
#include "bindings/reports.h"
#include "core/parallel.h"
#include "sampling/sample_surface.h"

namespace arapfields::python {
namespace {

SurfaceSamplesResult sample(const FunctionArgument& sdf, int count, std::int64_t seed, int threads,
                            Task* task) {
  const std::shared_ptr<const ImplicitFunction> function = as_function(sdf, "sdf");
  SampleReport done;
  py::object samples = py::cast(run_long(task, [&](const Progress& progress) {
    const ThreadScope scope(threads);
    return sample_surface(function, {.count = count, .seed = seed}, progress, &done);
  }));
  attach_report(samples,
                make_report("SampleReport", "lines"_a = done.lines,
                            "evaluations"_a = done.value_evaluations + done.gradient_evaluations,
                            "gradient_evaluations"_a = done.gradient_evaluations,
                            "model_evaluations"_a = done.model_evaluations, "lipschitz"_a = done.lipschitz,
                            "largest_value"_a = done.largest_value, "seconds"_a = done.seconds));
  return samples;
}

}  // namespace

void bind_sampling(py::module_& module) {
  module.def("sample_surface", &sample, "sdf"_a, "count"_a = SampleOptions().count, py::kw_only(),
             "seed"_a = SampleOptions().seed, "threads"_a = 0, "task"_a = py::none(),
             R"(
Samples of the zero surface of a signed distance function, uniform by area, with unit normals.

They are the crossings of random lines through the cube, thinned to `count` (1 to 100 million) at random, in
random order (Ling et al. 2025, "Uniform Sampling of Surfaces by Casting Rays"). Every sample has |sdf| ≤ 1e-4
of the cube's half side, nearly all ≤ 2e-6. The same seed gives the same samples. report is a SampleReport.
InvalidInput for a bad count and for a function without a zero surface in its cube.)");
}

}  // namespace arapfields::python
