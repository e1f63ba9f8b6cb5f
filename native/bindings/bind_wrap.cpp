// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/python_function.h"
#include "bindings/reports.h"
#include "wrap/sequence.h"
#include "wrap/suggestion.h"
#include "wrap/transfer.h"
#include "wrap/wrap.h"

namespace arapfields::python {
namespace {

std::vector<Landmark> as_landmarks(const LandmarksArgument& argument) {
  const std::string allowed = "pairs (rest, on_target) of places (3,) are needed";
  std::vector<Landmark> landmarks;
  for_each_item(
      argument, "landmarks", allowed, sizeof(Landmark), [&](const py::object& pair, const std::string& name) {
        Landmark landmark;
        int k = 0;
        for_each_item(pair, name, allowed, 0.0, [&](const py::object& place, const std::string& which) {
          require(k < 2, name, "more than two of them", allowed);
          (k++ == 0 ? landmark.rest : landmark.target) = as_vec3(place, which);
        });
        require(k == 2, name, std::to_string(k) + " of them", allowed);
        landmarks.push_back(landmark);
      });
  return landmarks;
}

/// The field with a WrapReport attached.
py::object with_report(const WrapSolution& solution) {
  py::object field = py::cast(solution.field);
  const WrapReport& r = solution.report;
  attach_report(
      field,
      make_report("WrapReport", "to_target_mean"_a = r.to_target_mean, "to_target_95"_a = r.to_target_95,
                  "from_target_mean"_a = r.from_target_mean, "from_target_95"_a = r.from_target_95,
                  "matched_share"_a = r.matched_share, "landmarks"_a = py::tuple(py::cast(r.landmarks)),
                  "left_out"_a = py::tuple(py::cast(r.left_out)), "diagonal"_a = r.diagonal,
                  "scale"_a = r.scale, "iterations"_a = r.iterations, "seconds"_a = r.seconds,
                  "notes"_a = py::tuple(py::cast(r.warnings)), **field_measures(r.arap, r.distortion)));
  return field;
}

WrapResult wrap_samples(const SurfaceSamples& samples, const FunctionArgument& target,
                        const LandmarksArgument& landmarks, WrapOptions options, Task* task) {
  const std::shared_ptr<const ImplicitFunction> function = as_function(target, "target");
  const std::vector<Landmark> pairs = as_landmarks(landmarks);
  return with_report(run_long(
      task, [&](const Progress& progress) { return wrap(samples, *function, pairs, options, progress); }));
}

py::array_t<double> suggest(const SurfaceSamples& samples, const FunctionArgument& target, int count,
                            WrapOptions options, Task* task) {
  const std::shared_ptr<const ImplicitFunction> function = as_function(target, "target");
  const std::vector<Landmark> pairs = run_long(task, [&](const Progress& progress) {
    return suggest_landmarks(samples, *function, count, options, progress);
  });
  py::array_t<double> result({static_cast<py::ssize_t>(pairs.size()), py::ssize_t{2}, py::ssize_t{3}});
  double* out = result.mutable_data();
  for (const Landmark& pair : pairs)
    for (const Vec3* end : {&pair.rest, &pair.target}) out = std::copy(end->begin(), end->end(), out);
  return result;
}

/// `end`: the share of the task's progress that this is.
Correspondence correspondence(const MovedArgument& field, const MeshArgument& source,
                              const MeshArgument& target, bool back, Task* task, double end = 1.0) {
  const TriangleMesh rest = as_mesh_pair(source, "source"), onto = as_mesh_pair(target, "target");
  const bool by_field = py::isinstance<DeformationField>(field);
  const auto* given = by_field ? &field.cast<const DeformationField&>() : nullptr;
  const Points moved = by_field ? Points() : as_finite_points(field, "field");
  return run_long(task, [&](const Progress& progress) {
    return Correspondence(given != nullptr ? WrappedMesh(rest, *given) : WrappedMesh(rest, moved), onto,
                          back ? Correspondence::Direction::to_source : Correspondence::Direction::to_target,
                          progress.part(0.0, end));
  });
}

/// Arrays whose vertices are one axis, as a matrix of a row a vertex, and back.
py::array_t<double> carried(const Correspondence& self, const ArrayArgument& argument, bool displacements,
                            Task* task = nullptr, double begin = 0.0) {
  const std::string name = displacements ? "displacements" : "values";
  const py::array_t<double> given = as_doubles(argument, name);
  std::vector<py::ssize_t> shape(given.shape(), given.shape() + given.ndim());
  const std::size_t axis = displacements && given.ndim() == 3 ? 1 : 0;
  require(displacements ? (given.ndim() == 2 || given.ndim() == 3) && shape.back() == 3 : given.ndim() > 0,
          name, "got shape " + py::str(given.attr("shape")).cast<std::string>(),
          displacements ? "(n, 3) or (k, n, 3) is needed" : "(n, …) is needed");
  require(shape[axis] == self.giving(), name, std::to_string(shape[axis]) + " vertices",
          std::to_string(self.giving()) + " are needed");
  const Index keys = axis == 1 ? shape[0] : 1, rows = shape[axis],
              columns = rows > 0 && keys > 0 ? given.size() / rows / keys : 0;
  shape[axis] = self.places().shares.rows();
  py::array_t<double> result(shape);
  double* out = result.mutable_data();
  run_long(task, [&](const Progress& whole) {
    const Progress progress = whole.part(begin, 1.0);
    for (Index k = 0; k < keys; ++k) {
      progress.report(static_cast<double>(k) / static_cast<double>(keys), "carrying");
      const Eigen::Map<const RowMatrix<double>> part(given.data() + k * rows * columns, rows, columns);
      const RowMatrix<double> moved =
          displacements ? RowMatrix<double>(self.displacements(part, progress)) : self.values(part);
      out = std::copy(moved.data(), moved.data() + moved.size(), out);
    }
    progress.report(1.0, "carrying");
  });
  return result;
}

TransferResult transfer(const MovedArgument& field, const MeshArgument& source, const MeshArgument& target,
                        const TransferArgument& what, bool back, Task* task) {
  const std::string allowed = "a dict of \"values\" and \"displacements\" is needed";
  require(py::isinstance<py::dict>(what), "what", "got " + type_text(what), allowed);
  py::dict result;
  constexpr double found = 0.3;  // of the progress
  std::optional<Correspondence> places;
  for (const auto& [key, array] : py::reinterpret_borrow<py::dict>(what)) {
    const std::string name = as_text(key, "what");
    require(name == "values" || name == "displacements", "what", "unknown key " + name, allowed);
    if (!places) places.emplace(correspondence(field, source, target, back, task, found));
    result[key] =
        carried(*places, py::reinterpret_borrow<ArrayArgument>(array), name == "displacements", task, found);
  }
  return TransferResult(result);
}

void bind_transfer(py::module_& module) {
  py::class_<Correspondence>(module, "Correspondence", R"(
Which place of one mesh belongs to each vertex of another, after a wrap of a source onto a target.

The places are the nearest ones of the wrapped source, on the side that faces the same way. Build one for any
number of arrays; `transfer` is the same for one use.)")
      .def(py::init([](const MovedArgument& field, const MeshArgument& source, const MeshArgument& target,
                       bool back, Task* task) { return correspondence(field, source, target, back, task); }),
           "field"_a, "source"_a, "target"_a, py::kw_only(), "back"_a = false, "task"_a = py::none(), R"(
field: the DeformationField of `wrap`, or the source's vertices as another tool wrapped them, (n, 3). source
and target: pairs (vertices, triangles). Gives to the target's vertices, with back=True to the source's.

Raises InvalidInput and Cancelled.)")
      .def_property_readonly(
          "triangles",
          [](const Correspondence& self) {
            return py::array_t<std::int32_t>(py::array(py::cast(self.places().triangles)));
          },
          "(m,) the triangle of the giving mesh on which each receiving vertex lies.")
      .def_property_readonly(
          "shares", [](const Correspondence& self) { return self.places().shares; },
          "(m, 3) barycentric coordinates on that triangle: not negative, of sum one.")
      .def_property_readonly(
          "distances", [](const Correspondence& self) { return self.places().distances; },
          "(m,) from each vertex to its place, in the target's units.")
      .def(
          "values",
          [](const Correspondence& self, const ArrayArgument& values) {
            return carried(self, values, false);
          },
          "values"_a, "Values (n, …) of the giving vertices, interpolated linearly: (m, …).")
      .def(
          "displacements",
          [](const Correspondence& self, const ArrayArgument& offsets, Task* task) {
            return carried(self, offsets, true, task);
          },
          "displacements"_a, py::kw_only(), "task"_a = py::none(), R"(
Displacements (n, 3) or (k, n, 3), as of shape keys: (…, m, 3), carried by the smoothest map of space that takes
the source's surface to where it was moved. No triangle folds which does not fold there.
Raises InvalidInput and Cancelled. Source: Duchon 1977; Sumner and Popović 2004.)");
  module.def("transfer", &transfer, "field"_a, "source"_a, "target"_a, "what"_a, py::kw_only(),
             "back"_a = false, "task"_a = py::none(), R"(
Carries what a mesh has over to the mesh that it was wrapped onto, or back.

`what` has arrays under "values" (n, …), such as weights or colours, and under "displacements" (n, 3) or
(k, n, 3), such as shape keys. The result has the same keys, with a row for each vertex of the target. Other
arguments as for Correspondence. Source: Sumner and Popović 2004. Raises InvalidInput and Cancelled.)");
}

void bind_sequence(py::module_& module) {
  py::class_<WrapSequence>(module, "WrapSequence", R"(
A surface that was wrapped onto the first frame of a scanned sequence, and follows the others.

Each frame starts from where the last one left the surface. Rigidity is measured from the first frame, so that
nothing drifts.)")
      .def(py::init<const SurfaceSamples&, const DeformationField&, const WrapOptions&>(), "samples"_a,
           "field"_a, py::arg_v("options", WrapOptions(), "WrapOptions()"), R"(
field: the DeformationField of `wrap` from these samples onto the first frame; or that of a later frame, behind
which the sequence goes on. options: as for `wrap`; stages, alignment and landmarks play no part. Raises
InvalidInput.)")
      .def(
          "next",
          [](WrapSequence& self, const FunctionArgument& target, Task* task) -> WrapResult {
            const std::shared_ptr<const ImplicitFunction> function = as_function(target, "target");
            return with_report(
                run_long(task, [&](const Progress& progress) { return self.next(*function, progress); }));
          },
          "target"_a, py::kw_only(), "task"_a = py::none(), R"(
The DeformationField from rest onto the next frame, an ImplicitFunction as `wrap` takes it. field.report is a
WrapReport. Raises InvalidInput and Cancelled; then the sequence is as it was.)")
      .def_property(
          "state", [](const WrapSequence& self) { return run_long([&] { return self.state(); }); },
          [](WrapSequence& self, const ArrayArgument& state) {
            const Points given = as_finite_points(state, "state");
            run_long([&] { self.set_state(given); });
          },
          R"(
(m, 3) what changes from frame to frame. Set to that of an earlier frame, the sequence goes on behind that one;
with the first frame's field it is all that a sequence keeps. Raises InvalidInput.)")
      .def_property_readonly(
          "field", [](const WrapSequence& self) { return run_long([&] { return self.field(); }); }, R"(
The DeformationField from rest to the frame of `state`, without a report.)");
}

}  // namespace

void bind_wrap(py::module_& module) {
  bind_transfer(module);
  bind_sequence(module);
  module.def("wrap", &wrap_samples, "samples"_a, "target"_a, "landmarks"_a = py::tuple(),
             py::arg_v("options", WrapOptions(), "WrapOptions()"), py::kw_only(), "task"_a = py::none(), R"(
The DeformationField that lays a surface onto the zero surface of `target`, as rigidly as possible.

`target` is an ImplicitFunction: a MeshSdf, which may be open and broken, a NeuralSdf, or a subclass of your
own. The surface is first moved, rotated and scaled as a whole, then deformed in stages of falling stiffness.
`landmarks` are pairs (rest, on_target) of corresponding points (3,). Without them the best of many rotations
is taken, which suits shapes that are alike. Pairs that contradict the others are left out and named in the
report; those of a mirror image are refused.

Parts without a counterpart on an open target follow their neighbours. The samples' weights set where the
surface is stiffer. field.report is a WrapReport. Raises InvalidInput and Cancelled.)");
  module.def("suggest_landmarks", &suggest, "samples"_a, "target"_a, "count"_a = 8,
             py::arg_v("options", WrapOptions(), "WrapOptions()"), py::kw_only(), "task"_a = py::none(), R"(
Pairs of landmarks (k, 2, 3) for `wrap`, at most `count`: places at rest and on the target.

They are ends of the shape, which lie far from each other inside it, and where a coarse wrap without landmarks
takes them. Look at them before use. Arguments as for `wrap`. Raises InvalidInput and Cancelled.)");
}

}  // namespace arapfields::python
