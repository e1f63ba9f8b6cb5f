// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arguments.h"
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/reports.h"
#include "mesh/sample_mesh.h"
#include "options/sampling.h"
#include "sampling/sample_weights.h"

namespace arapfields::python {
namespace {

Vector optional_vector(const std::optional<ArrayArgument>& value, const std::string& argument) {
  return value ? as_vector(*value, argument) : Vector();
}

SurfaceSamples checked_samples(const ArrayArgument& points, const ArrayArgument& normals,
                               const std::optional<Frame>& frame, const std::optional<ArrayArgument>& weights,
                               const std::optional<ArrayArgument>& bend_weights) {
  const Points p = as_points(points, "points");
  Points n = as_points(normals, "normals");
  require(p.rows() > 0, "points", "there are none", "at least one is needed");
  require(p.allFinite(), "points", "some coordinates are NaN or infinite", "all must be finite");
  require(n.rows() == p.rows(), "normals", std::to_string(n.rows()) + " of them",
          "as many as points are needed, " + std::to_string(p.rows()));
  for (Index i = 0; i < n.rows(); ++i) {
    const double length = n.row(i).stableNorm();
    require(std::isfinite(length) && length > 0.0, "normals",
            "normal " + std::to_string(i) + " is zero or not finite", "each must have a direction");
    n.row(i) /= length;
  }
  const Frame used = frame ? *frame : Frame::balanced(p, Vector::Ones(p.rows()));
  return with_weights({used.to_cube(p), n, used, {}}, optional_vector(weights, "weights"),
                      optional_vector(bend_weights, "bend_weights"));
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
  std::vector<TriangleMesh> read;
  for_each_item(
      meshes, "meshes", allowed, sizeof(TriangleMesh), [&](const py::object& item, const std::string& name) {
        require(py::isinstance<py::sequence>(item) && py::len(item) == 2, name, "got " + type_text(item),
                allowed);
        const auto pair = py::reinterpret_borrow<py::sequence>(item);
        read.push_back(
            {as_points(py::object(pair[0]), name + "[0]"), as_triangles(py::object(pair[1]), name + "[1]")});
      });
  std::vector<VertexWeights> painted;
  read_painted(weights, "weights", read.size(), painted, &VertexWeights::weights);
  read_painted(bend_weights, "bend_weights", read.size(), painted, &VertexWeights::bend_weights);
  return run_long(nullptr, [&](const Progress&) { return sample_meshes(read, count, seed, painted); });
}

Vector or_ones(const Vector& weights, Index count) {
  return weights.size() > 0 ? weights : Vector::Ones(count);
}

std::string text(const Frame& frame) {
  return py::cast<std::string>(
      py::str("center=({:g}, {:g}, {:g}), scale={:g}")
          .format(frame.center.x(), frame.center.y(), frame.center.z(), frame.scale));
}

}  // namespace

void bind_mesh(py::module_& module) {
  py::class_<SurfaceSamples>(
      module, "SurfaceSamples", py::dynamic_attr(),
      "Points spread uniformly by area over a rest surface, with outward unit normals.\n\n"
      "Arrays are in mesh coordinates; `frame` maps them to the unit cube in which fields\n"
      "and energies live, and fields solved on the samples inherit it.")
      .def(py::init(&checked_samples), "points"_a, "normals"_a, "frame"_a = py::none(), py::kw_only(),
           "weights"_a = py::none(), "bend_weights"_a = py::none(),
           "points (n,3), normals (n,3), both in mesh coordinates; normals are brought to unit length.\n"
           "Without a frame, the points' centroid is the centre and their radius of gyration 0.6 of the "
           "cube's half.\n"
           "`weights` (n,) and `bend_weights` (n,) as in with_weights.\n"
           "InvalidInput for unequal counts, numbers that are not finite, or normals without direction.")
      .def(
          "with_weights",
          [](const SurfaceSamples& s, const std::optional<ArrayArgument>& weights,
             const std::optional<ArrayArgument>& bend_weights) {
            const Vector w = optional_vector(weights, "weights");
            const Vector b = optional_vector(bend_weights, "bend_weights");
            return run_long(nullptr, [&](const Progress&) { return with_weights(s, w, b); });
          },
          "weights"_a = py::none(), "bend_weights"_a = py::none(),
          "The same samples with factors (n,) ≥ 0 on their energies, and (n,) on the bending in them: bones\n"
          "and armour have large ones, skin small ones. None: 1 everywhere. deform, stylize and "
          "LiveDeformer\n"
          "minimise mean w (stretch + λ b bend). InvalidInput for other counts, negative or non-finite "
          "numbers.")
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
          "(n,) which of sample_meshes' meshes each sample lies on.")
      .def_property_readonly(
          "points", [](const SurfaceSamples& s) { return s.frame.to_mesh(s.points); },
          "(n,3) in mesh coordinates; a new array each time.")
      .def_property_readonly(
          "normals", [](const SurfaceSamples& s) { return s.normals; }, "(n,3), unit length.")
      .def_readonly("frame", &SurfaceSamples::frame, "Mesh coordinates and the unit cube.")
      .def_property_readonly(
          "report", [](const py::object& self) { return SampleReportResult(report_of(self)); },
          "What sample_surface did; AttributeError for samples of anything else.")
      .def("__len__", [](const SurfaceSamples& s) { return s.size(); })
      .def("__repr__", [](const SurfaceSamples& s) {
        return "SurfaceSamples(" + std::to_string(s.size()) + " points, " + text(s.frame) + ")";
      });

  module.def(
      "sample_mesh",
      [](const ArrayArgument& vertices, const ArrayArgument& triangles, Index count, std::uint64_t seed,
         const std::optional<ArrayArgument>& weights, const std::optional<ArrayArgument>& bend_weights) {
        const Points v = as_points(vertices, "vertices");
        const Triangles f = as_triangles(triangles, "triangles");
        const VertexWeights painted{optional_vector(weights, "weights"),
                                    optional_vector(bend_weights, "bend_weights")};
        return run_long(nullptr, [&](const Progress&) { return sample_mesh(v, f, count, seed, painted); });
      },
      "vertices"_a, "triangles"_a, "count"_a = SampleOptions().count, py::kw_only(),
      "seed"_a = SampleOptions().seed, "weights"_a = py::none(), "bend_weights"_a = py::none(),
      "Independent samples of a mesh, uniform by area, with the triangles' unit normals.\n\n"
      "vertices (n,3), triangles (m,3) counter-clockwise seen from outside. The frame is centred at the\n"
      "centroid of the area, and scaled so that its radius of gyration is 0.6: it turns, moves and scales\n"
      "with the mesh. Sample i depends on the seed and i alone. `weights` (n,) and `bend_weights` (n,) say\n"
      "how stiff the mesh is about its vertices, and against bending; samples take them from the corners.\n"
      "InvalidInput for a broken mesh, one without area, a count below 1, or weights that do not fit.");
  module.def(
      "sample_meshes", &samples_of_meshes, "meshes"_a, "count"_a = SampleOptions().count, py::kw_only(),
      "seed"_a = SampleOptions().seed, "weights"_a = py::none(), "bend_weights"_a = py::none(),
      "Samples of several meshes that are to deform as one, a body and its sleeves: uniform by area over "
      "all\n"
      "of them, so that each gets its share of the area of the count.\n\n"
      "meshes: pairs (vertices, triangles) as for sample_mesh. The first is the body: the samples have the\n"
      "frame that sample_mesh gives it. `weights` and `bend_weights` list an array, or None, for each mesh.\n"
      "samples.mesh_indices says which mesh each sample lies on. InvalidInput names the mesh that is "
      "broken.");
}

}  // namespace arapfields::python
