// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/bind.h"
#include "bindings/jet_arrays.h"
#include "core/device.h"
#include "solve/loss_probe.h"

namespace arapfields::python {
namespace {

/// A small network in double precision, with whatever fixed parts and terms a test asks for.
class Probe {
 public:
  Probe(const SurfaceSamples& samples, const std::vector<Handle>& handles, int width, double bending,
        const Points& preferred, double gauss, double barrier, double margin)
      : samples_(samples),
        field_(MlpShape{{width, 2, 2, 1.0, 5.0}, 3}, 0, true),
        objective_(samples_, terms(samples_, handles, bending, preferred, gauss, barrier)) {
    if (margin > 0.0) field_.set_handles(blend(objective_.terms().handles, margin));
  }
  py::tuple operator()(const Vector& parameters, std::uint64_t seed) {
    const LossProbe probe = probe_loss(field_, objective_, parameters, seed);
    return py::make_tuple(probe.loss, probe.gradient);
  }
  Index size() const { return field_.weights().size(); }

 private:
  static ObjectiveTerms terms(const SurfaceSamples& samples, const std::vector<Handle>& handles,
                              double bending, const Points& preferred, double gauss, double barrier) {
    ObjectiveTerms terms;
    terms.batch = 20;
    terms.surface.bending = bending;
    if (preferred.rows() > 0) terms.preference = gauss_preference(preferred);
    terms.gauss = gauss;
    terms.surface.barrier = barrier;
    terms.surface.barrier_threshold = 0.9;
    terms.handles = BoundHandles(handles, samples.points);
    terms.pull.handle_batch = 8;
    return terms;
  }
  static std::shared_ptr<const HandleBlend> blend(const BoundHandles& handles, double margin) {
    std::vector<RigidRegion> regions;
    for (Index i = 0; i < handles.count(); ++i)
      regions.push_back({handles.handle(i).rest, handles.motion(i), margin, ""});
    return std::make_shared<HandleBlend>(std::move(regions));
  }

  SurfaceSamples samples_;
  NeuralField field_;
  FieldObjective objective_;
};

}  // namespace

void bind_solve_testing(py::module_& module) {
  py::module_ testing = testing_module(module);
  py::class_<Probe>(testing, "LossProbe")
      .def(py::init<const SurfaceSamples&, const std::vector<Handle>&, int, double, const Points&, double,
                    double, double>(),
           "samples"_a, "handles"_a, "width"_a = 8, "bending"_a = 0.0, "preferred"_a = Points(),
           "gauss"_a = 0.0, "barrier"_a = 0.0, "margin"_a = 0.0)
      .def("__call__", &Probe::operator(), "parameters"_a, "seed"_a = 0)
      .def_property_readonly("size", &Probe::size);
  py::class_<AtenPathScope, std::unique_ptr<AtenPathScope>>(
      testing, "AtenPath", "While it lives, tensors are worked on as on a device instead of by kernels.")
      .def(py::init<>());
  py::class_<EnergyTrial>(testing, "EnergyTrial", "The energy and its parameter gradient, for timing.")
      .def(py::init<const SurfaceSamples&, Index, double>(), "samples"_a, "batch"_a, "bending"_a)
      .def("run", &EnergyTrial::run, py::call_guard<py::gil_scoped_release>());
}

}  // namespace arapfields::python
