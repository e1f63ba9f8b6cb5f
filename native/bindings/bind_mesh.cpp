// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/bind.h"
#include "mesh/sample_mesh.h"
#include "options/sampling.h"

namespace arapfields::python {
namespace {

SurfaceSamples checked_samples(const py::object& points, const py::object& normals,
                               const std::optional<Frame>& frame) {
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
  return {used.to_cube(p), n, used, {}};
}

std::string text(const Frame& frame) {
  return py::cast<std::string>(
      py::str("center=({:g}, {:g}, {:g}), scale={:g}")
          .format(frame.center.x(), frame.center.y(), frame.center.z(), frame.scale));
}

}  // namespace

void bind_mesh(py::module_& module) {
  py::class_<SurfaceSamples>(
      module, "SurfaceSamples",
      "Points spread uniformly by area over a rest surface, with outward unit normals.\n\n"
      "Arrays are in mesh coordinates; `frame` maps them to the unit cube in which fields\n"
      "and energies live, and fields solved on the samples inherit it.")
      .def(py::init(&checked_samples), "points"_a, "normals"_a, "frame"_a = py::none(),
           "points (n,3), normals (n,3), both in mesh coordinates; normals are brought to unit length.\n"
           "Without a frame, the points' centroid is the centre and their radius of gyration 0.6 of the "
           "cube's half.\n"
           "InvalidInput for unequal counts, numbers that are not finite, or normals without direction.")
      .def_property_readonly(
          "points", [](const SurfaceSamples& s) { return s.frame.to_mesh(s.points); },
          "(n,3) in mesh coordinates; a new array each time.")
      .def_property_readonly(
          "normals", [](const SurfaceSamples& s) { return s.normals; }, "(n,3), unit length.")
      .def_readonly("frame", &SurfaceSamples::frame, "Mesh coordinates and the unit cube.")
      .def("__len__", [](const SurfaceSamples& s) { return s.size(); })
      .def("__repr__", [](const SurfaceSamples& s) {
        return "SurfaceSamples(" + std::to_string(s.size()) + " points, " + text(s.frame) + ")";
      });

  module.def(
      "sample_mesh",
      [](const py::object& vertices, const py::object& triangles, Index count, std::uint64_t seed) {
        const Points v = as_points(vertices, "vertices");
        const Triangles f = as_triangles(triangles, "triangles");
        return run_long(nullptr, [&](const Progress&) { return sample_mesh(v, f, count, seed); });
      },
      "vertices"_a, "triangles"_a, "count"_a = SampleOptions().count, "seed"_a = SampleOptions().seed,
      "Independent samples of a mesh, uniform by area, with the triangles' unit normals.\n\n"
      "vertices (n,3), triangles (m,3) counter-clockwise seen from outside. The frame is centred at the\n"
      "centroid of the area, and scaled so that its radius of gyration is 0.6: it turns, moves and scales\n"
      "with the mesh. Sample i depends on the seed and i alone.\n"
      "InvalidInput for a broken mesh, one without area, or a count below 1.");
}

}  // namespace arapfields::python
