// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/pickling.h"
#include "bindings/reports.h"
#include "mesh/sample_mesh.h"
#include "options/sampling.h"
#include "sampling/sample_weights.h"

namespace arapfields::python {
namespace {

SurfaceSamples checked_samples(const ArrayArgument& points, const ArrayArgument& normals,
                               const std::optional<Frame>& frame, const std::optional<ArrayArgument>& weights,
                               const std::optional<ArrayArgument>& bend_weights) {
  const Points p = as_finite_points(points, "points");
  Points n = as_points(normals, "normals");
  require(p.rows() > 0, "points", "there are none", "at least one is needed");
  require(n.rows() == p.rows(), "normals", std::to_string(n.rows()) + " of them",
          "as many as points are needed, " + std::to_string(p.rows()));
  for (Index i = 0; i < n.rows(); ++i) {
    const double length = n.row(i).stableNorm();
    require(std::isfinite(length) && length > 0.0, "normals",
            "normal " + std::to_string(i) + " is zero or not finite", "each must have a direction");
    n.row(i) /= length;
  }
  const Frame used = frame ? *frame : Frame::balanced(p, Vector::Ones(p.rows()));
  return with_weights({used.to_cube(p), n, used, {}}, as_vector(weights, "weights"),
                      as_vector(bend_weights, "bend_weights"));
}

/// Arrays of each of several meshes; None stands for none.
void read_painted(const std::optional<OptionalArraysArgument>& given, const std::string& argument,
                  std::size_t meshes, std::vector<VertexWeights>& painted, Vector VertexWeights::* member) {
  if (!given) return;
  painted.resize(meshes);
  const std::string allowed = "an array or None for each of the " + std::to_string(meshes) + " meshes";
  std::size_t i = 0;
  for_each_item(*given, argument, allowed, 0.0, [&](const py::object& item, const std::string& name) {
    require(i < meshes, argument, "there are more of them", allowed);
    if (!item.is_none()) painted[i].*member = as_vector(item, name);
    ++i;
  });
  require(i == meshes, argument, std::to_string(i) + " of them", allowed);
}

SurfaceSamples samples_of_meshes(const MeshesArgument& meshes, Index count, std::uint64_t seed,
                                 const std::optional<OptionalArraysArgument>& weights,
                                 const std::optional<OptionalArraysArgument>& bend_weights) {
  const std::string allowed = "pairs (vertices, triangles) are needed";
  std::vector<TriangleMesh> result;
  for_each_item(
      meshes, "meshes", allowed, sizeof(TriangleMesh), [&](const py::object& item, const std::string& name) {
        require(py::isinstance<py::sequence>(item) && py::len(item) == 2, name, "got " + type_text(item),
                allowed);
        const auto pair = py::reinterpret_borrow<py::sequence>(item);
        result.push_back(
            {as_points(py::object(pair[0]), name + "[0]"), as_triangles(py::object(pair[1]), name + "[1]")});
      });
  std::vector<VertexWeights> painted;
  read_painted(weights, "weights", result.size(), painted, &VertexWeights::weights);
  read_painted(bend_weights, "bend_weights", result.size(), painted, &VertexWeights::bend_weights);
  return run_long([&] { return sample_meshes(result, count, seed, painted); });
}

Vector or_ones(const Vector& weights, Index count) {
  return weights.size() > 0 ? weights : Vector::Ones(count);
}

/// All but `redraw`, which is a function.
py::tuple state_of(const py::object& self) {
  const auto& s = self.cast<const SurfaceSamples&>();
  py::object mesh = py::none();
  if (s.mesh) mesh = py::make_tuple(s.mesh->vertices, s.mesh->triangles);
  return py::make_tuple(s.points, s.normals, s.frame, s.weights, s.bend_weights,
                        py::array_t<std::int32_t>(py::array(py::cast(s.mesh_indices))), mesh,
                        self.attr("__dict__"), s.sheet_sizes);
}

std::pair<SurfaceSamples, py::dict> samples_of_state(const py::tuple& parts) {
  const PickledState state(parts, "SurfaceSamples", 9);
  SurfaceSamples samples;
  samples.points = state.points(0);
  const Index count = samples.size();
  require(count > 0, state.name(0), "there are none", "at least one is needed");
  samples.normals = state.matrix(1, count, 3);
  require((samples.normals.rowwise().squaredNorm().array() < 1.001).all(), state.name(1),
          "some are longer than 1", "unit normals are needed");
  samples.frame = state.of<Frame>(2, "Frame");
  samples.weights = state.vector(3), samples.bend_weights = state.vector(4);
  require_weights(state.name(3), samples.weights, count);
  require_weights(state.name(4), samples.bend_weights, count);
  for (const Index mesh : as_indices(state[5], state.name(5))) {
    require(mesh >= 0 && mesh <= INT32_MAX, state.name(5), std::to_string(mesh), "an index is needed");
    samples.mesh_indices.push_back(static_cast<std::int32_t>(mesh));
  }
  require(samples.mesh_indices.empty() || std::ssize(samples.mesh_indices) == count, state.name(5),
          std::to_string(samples.mesh_indices.size()) + " of them", "one for each sample is needed");
  if (state.has(6)) {
    auto mesh = std::make_shared<TriangleMesh>(as_mesh_pair(state[6], state.name(6)));
    validate(*mesh);
    samples.mesh = std::move(mesh);
  }
  samples.sheet_sizes = state.vector(8);
  require_weights(state.name(8), samples.sheet_sizes, count);
  require(py::isinstance<py::dict>(state[7]), state.name(7), "got " + type_text(state[7]),
          "a dict is needed");
  return {std::move(samples), py::reinterpret_borrow<py::dict>(state[7])};
}

/// A copy that can be drawn anew, as its original can.
SurfaceSamplesResult copied(const SurfaceSamplesResult& self) {
  const py::object result = py::cast(SurfaceSamples(self.cast<const SurfaceSamples&>()));
  result.attr("__dict__").attr("update")(self.attr("__dict__"));
  return SurfaceSamplesResult(result);
}

std::string text(const Frame& frame) {
  return py::cast<std::string>(
      py::str("center=({:g}, {:g}, {:g}), scale={:g}")
          .format(frame.center.x(), frame.center.y(), frame.center.z(), frame.scale));
}

}  // namespace

void bind_mesh(py::module_& module) {
  py::class_<SurfaceSamples>(module, "SurfaceSamples", py::dynamic_attr(),
                             R"(
Points distributed uniformly by area over a rest surface, with outward unit normals.

Arrays are in mesh coordinates. `frame` maps them to the unit cube in which fields and energies live; fields
solved on the samples inherit it. Unpickled samples are not drawn anew (DeformOptions.fresh_samples).)")
      .def(py::init(&checked_samples), "points"_a, "normals"_a, "frame"_a = py::none(), py::kw_only(),
           "weights"_a = py::none(), "bend_weights"_a = py::none(),
           R"(
points (n, 3) and normals (n, 3) in mesh coordinates; normals are scaled to unit length.

Without a frame the points' centroid is its centre, and their radius of gyration is 0.6 of the cube's half
side. `weights` (n,) and `bend_weights` (n,) are those of with_weights. InvalidInput for unequal counts,
numbers that are not finite, and normals of length 0.)")
      .def(
          "with_weights",
          [](const SurfaceSamples& s, const std::optional<ArrayArgument>& weights,
             const std::optional<ArrayArgument>& bend_weights) {
            const Vector w = as_vector(weights, "weights"), b = as_vector(bend_weights, "bend_weights");
            return run_long([&] { return with_weights(s, w, b); });
          },
          "weights"_a = py::none(), "bend_weights"_a = py::none(),
          R"(
The same samples with factors (n,) ≥ 0 on their energies, and (n,) ≥ 0 on their bending; None is 1 everywhere.

Large factors make bones or armour, small ones skin. deform, stylize and LiveDeformer minimise
mean w (stretch + λ b bend). InvalidInput for other counts, and for negative or non-finite numbers.)")
      .def_property_readonly(
          "weights", [](const SurfaceSamples& s) { return or_ones(s.weights, s.size()); },
          "(n,) factors of the samples' energies.")
      .def_property_readonly(
          "bend_weights", [](const SurfaceSamples& s) { return or_ones(s.bend_weights, s.size()); },
          "(n,) factors of the bending in them.")
      .def_property_readonly(
          "mesh_indices",
          [](const SurfaceSamples& s) {
            Eigen::VectorXi result = Eigen::VectorXi::Zero(s.size());
            for (std::size_t i = 0; i < s.mesh_indices.size(); ++i) result[i] = s.mesh_indices[i];
            return result;
          },
          "(n,) index of each sample's mesh among those given to sample_meshes.")
      .def_property_readonly(
          "points", [](const SurfaceSamples& s) { return s.frame.to_mesh(s.points); },
          "(n,3) in mesh coordinates; a new array each time.")
      .def_property_readonly(
          "normals", [](const SurfaceSamples& s) { return s.normals; }, "(n,3), unit length.")
      .def_readonly("frame", &SurfaceSamples::frame, "Mesh coordinates and the unit cube.")
      .def_property_readonly(
          "report", [](const py::object& self) { return SampleReportResult(report_of(self)); },
          "The SampleReport of sample_surface; AttributeError for other samples.")
      .def("__len__", [](const SurfaceSamples& s) { return s.size(); })
      .def(py::pickle(&state_of, &samples_of_state))
      .def("__copy__", &copied)
      .def(
          "__deepcopy__", [](const SurfaceSamplesResult& self, const py::dict&) { return copied(self); },
          "memo"_a)
      .def("__repr__", [](const SurfaceSamples& s) {
        return "SurfaceSamples(" + std::to_string(s.size()) + " points, " + text(s.frame) + ")";
      });

  module.def(
      "sample_mesh",
      [](const ArrayArgument& vertices, const ArrayArgument& triangles, Index count, std::uint64_t seed,
         const std::optional<ArrayArgument>& weights, const std::optional<ArrayArgument>& bend_weights) {
        const TriangleMesh mesh = as_mesh(vertices, triangles);
        const VertexWeights painted{as_vector(weights, "weights"), as_vector(bend_weights, "bend_weights")};
        return run_long([&] { return sample_mesh(mesh.vertices, mesh.triangles, count, seed, painted); });
      },
      "vertices"_a, "triangles"_a, "count"_a = SampleOptions().count, py::kw_only(),
      "seed"_a = SampleOptions().seed, "weights"_a = py::none(), "bend_weights"_a = py::none(),
      R"(
Independent samples of a mesh, uniform by area, with the triangles' unit normals.

vertices (n, 3), triangles (m, 3) counter-clockwise seen from outside. The frame is centred at the centroid
of the area, with a radius of gyration of 0.6, so that it rotates, moves and scales with the mesh. Sample i
depends on the seed and on i alone; where all miss small things far from the rest, the last samples, an
eighth of them at most, lie on these. `weights` (n,) and `bend_weights` (n,) are the stiffness at each vertex
and against bending; samples interpolate them. InvalidInput for a broken mesh, one without area, a count
below 1, and weights that do not fit.)");
  module.def("sample_meshes", &samples_of_meshes, "meshes"_a, "count"_a = SampleOptions().count,
             py::kw_only(), "seed"_a = SampleOptions().seed, "weights"_a = py::none(),
             "bend_weights"_a = py::none(),
             R"(
Samples of several meshes that deform as one, such as a body and its sleeves, uniform by area over all.

meshes: pairs (vertices, triangles) as in sample_mesh. The first mesh is the body: the samples have the frame
that sample_mesh gives it. `weights` and `bend_weights` list an array, or None, for each mesh.
samples.mesh_indices is the mesh of each sample. InvalidInput names the mesh that is broken.)");
}

}  // namespace arapfields::python
