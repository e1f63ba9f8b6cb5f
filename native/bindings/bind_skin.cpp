// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/pickling.h"
#include "skin/correctives.h"
#include "skin/rig_shape.h"
#include "skin/skin_weights.h"
#include "skin/skinning.h"

namespace arapfields::python {
namespace {

Bone make_bone(const ArrayArgument& head, const ArrayArgument& tail, const std::optional<Index>& parent,
               double roll, bool deform, const std::optional<ArrayArgument>& limits, std::string name) {
  Bone bone{as_vec3(head, "head"), as_vec3(tail, "tail"), parent.value_or(-1), roll, deform};
  bone.name = std::move(name);
  if (limits) {
    const Eigen::MatrixXd read = as_matrix(*limits, "limits");
    require(read.rows() == 3 && read.cols() == 2, "limits", "another shape", "(3, 2) angles are needed");
    bone.limits = read;
  }
  return bone;
}

std::vector<Bone> as_bones(const BonesArgument& bones) {
  return as_items<Bone>(bones, "bones", "Bones are needed");
}

Eigen::MatrixXd weights_of(const ShapeArgument& shape, const BonesArgument& bones, const SkinOptions& options,
                           const std::optional<ArrayArgument>& weights,
                           const std::optional<ArrayArgument>& bend_weights, Task* task) {
  const std::vector<Bone> rig = as_bones(bones);
  const auto on = [&](const auto& given, const auto&... painted) {
    return Eigen::MatrixXd(run_long(task, [&](const Progress& progress) {
                             return skin_weights(given, rig, options, progress, painted...);
                           }).template cast<double>());
  };
  const VertexWeights painted{as_vector(weights, "weights"), as_vector(bend_weights, "bend_weights")};
  if (py::isinstance<SurfaceSamples>(shape)) {
    require(!weights && !bend_weights, weights ? "weights" : "bend_weights", "given beside samples",
            "samples have their own, by with_weights");
    return on(shape.cast<const SurfaceSamples&>());
  }
  return on(as_mesh_pair(shape, "mesh", "a pair (vertices, triangles) or SurfaceSamples are needed"),
            painted);
}

std::vector<Mat4> as_motions(const ArraysArgument& motions) {
  std::vector<Mat4> result;
  for_each_item(
      motions, "motions", "one (4, 4) for each bone is needed", sizeof(Mat4),
      [&](const py::object& item, const std::string& name) { result.push_back(as_matrix4(item, name)); });
  return result;
}

Corrective corrective_of_state(const py::tuple& parts) {
  const PickledState state(parts, "Corrective", 3);
  Corrective corrective{state.index(0), {}, state.points(2)};
  const Eigen::MatrixXd coefficients = state.matrix(1, 9, 1);
  std::copy_n(coefficients.data(), 9, corrective.coefficients.begin());
  return corrective;
}

}  // namespace

void bind_skin(py::module_& module) {
  py::class_<Bone>(module, "Bone", R"(
A bone at rest, in mesh coordinates.

Its y axis runs from head to tail; `roll` (radians) turns the others about it, as in Blender. `parent` is an
index among all bones. A bone with deform=False has no weights. `limits` (3, 2) are the lowest and highest
components of its rotation vector in its own axes, in radians.)")
      .def(py::init(&make_bone), "head"_a, "tail"_a, "parent"_a = py::none(), "roll"_a = 0.0, py::kw_only(),
           "deform"_a = true, "limits"_a = py::none(), "name"_a = "")
      .def_readonly("head", &Bone::head)
      .def_readonly("tail", &Bone::tail)
      .def_property_readonly(
          "parent", [](const Bone& self) { return self.parent < 0 ? std::optional<Index>() : self.parent; })
      .def_readonly("roll", &Bone::roll)
      .def_property_readonly("box", &bone_box, "(4, 4) the cube [-1, 1]³ → a box along it, in its axes.")
      .def_readonly("deform", &Bone::deform)
      .def_readonly("limits", &Bone::limits, "(3, 2), or None.")
      .def_readonly("name", &Bone::name)
      .def("__repr__", [](const Bone& self) { return "Bone(" + self.name + ")"; });
  module.def("skin_weights", &weights_of, "mesh"_a, "bones"_a,
             py::arg_v("options", SkinOptions(), "SkinOptions()"), py::kw_only(), "weights"_a = py::none(),
             "bend_weights"_a = py::none(), "task"_a = py::none(), R"(
Weights (n, bones) for linear blend skinning: not negative, of sum one, at most options.influences a vertex.

`mesh` is a pair (vertices, triangles), of which several meshes may be parts, or SurfaceSamples, which get the
weights. The field poses the shape by its bones, and the weights are those that come nearest to it. How the
triangles are joined does not matter. A bone pulls as far as it is inside of the shape; one whose tail is
outside ends at its children. Bones far off the surface, and coincident_bones, have weights of 0. `weights` and `bend_weights` (n,) are the vertices' stiffness, as of
sample_mesh. Raises InvalidInput and Cancelled.)");
  module.def(
      "coincident_bones", [](const BonesArgument& bones) { return coincident_bones(as_bones(bones)); },
      "bones"_a, R"(
Deforming bones that lie where another does, as control bones do: pairs (index, index of the other).

skin_weights passes over the first of each pair. The other is the one nearest to its parent, of several the
first. Raises InvalidInput.)");
  py::class_<Corrective>(module, "Corrective", "A shape key that takes a skin to the field's poses.")
      .def_readonly("bone", &Corrective::bone, "Index of the bone whose rotation drives it.")
      .def_property_readonly(
          "coefficients", [](const Corrective& self) { return self.coefficients; },
          "Of wx, wy, wz, xx, yy, zz, xy, xz, yz of the rotation's unit quaternion (w, x, y, z).")
      .def_readonly("offsets", &Corrective::offsets,
                    "(n, 3) from the vertices at rest, where its value is 1.")
      .def(
          "value",
          [](const Corrective& self, const ArrayArgument& rotation) {
            return self.value(as_rotation(rotation, "rotation"));
          },
          "rotation"_a, "Its value for a rotation (3, 3) of the bone in its own axes; 0 at rest.")
      .def(py::pickle(
          [](const Corrective& self) {
            const Eigen::Map<const Eigen::Matrix<double, 9, 1>> coefficients(self.coefficients.data());
            return py::make_tuple(self.bone, Eigen::MatrixXd(coefficients), self.offsets);
          },
          &corrective_of_state));
  module.def(
      "skin_correctives",
      [](const ArrayArgument& vertices, const ArrayArgument& triangles, const BonesArgument& bones,
         const ArrayArgument& weights, const SkinOptions& options,
         const std::optional<ArrayArgument>& stiffness, const std::optional<ArrayArgument>& bend_weights,
         Task* task) {
        const TriangleMesh mesh = as_mesh(vertices, triangles);
        const std::vector<Bone> rig = as_bones(bones);
        const RowMatrix<float> shares = as_matrix(weights, "weights").cast<float>();
        const VertexWeights painted{as_vector(stiffness, "stiffness"),
                                    as_vector(bend_weights, "bend_weights")};
        return run_long(task, [&](const Progress& progress) {
          return skin_correctives(mesh, rig, shares, options, progress, painted);
        });
      },
      "vertices"_a, "triangles"_a, "bones"_a, "weights"_a,
      py::arg_v("options", SkinOptions(), "SkinOptions()"), py::kw_only(), "stiffness"_a = py::none(),
      "bend_weights"_a = py::none(), "task"_a = py::none(), R"(
At most options.correctives shape keys that take linear blend skinning with these weights to the field's poses.

Each is driven by one joint: its value is a polynomial of the rotation's quaternion. Those that gain most come
first. `stiffness` and `bend_weights` (n,) are as skin_weights' `weights` and `bend_weights`. Raises InvalidInput and Cancelled.)");
  module.def(
      "skin",
      [](const ArrayArgument& vertices, const ArrayArgument& weights, const ArraysArgument& motions,
         const std::string& method) {
        require(method == "linear" || method == "dual_quaternion", "method", method,
                "linear or dual_quaternion");
        const Points points = as_points(vertices, "vertices");
        const RowMatrix<float> shares = as_matrix(weights, "weights").cast<float>();
        const std::vector<Mat4> moved = as_motions(motions);
        return run_long([&] {
          return skin(points, shares, moved,
                      method == "linear" ? SkinMethod::linear : SkinMethod::dual_quaternion);
        });
      },
      "vertices"_a, "weights"_a, "motions"_a, "method"_a = "linear", R"(
Vertices (n, 3) moved by their weights (n, bones) and the bones' motions (bones, 4, 4) from rest.

`method` is "linear" or "dual_quaternion", which keeps volume and takes rigid motions alone.)");
  module.def(
      "bone_handles",
      [](const SurfaceSamples& samples, const BonesArgument& bones) {
        const std::vector<Bone> rig = as_bones(bones);
        return run_long([&] { return bone_handles(samples, rig); });
      },
      "samples"_a, "bones"_a, R"(
The deforming bones as handles at rest, in their order: what skin_weights poses the shape by.

Each is a RegionHandle that holds the samples about the bone's middle.)");
}

}  // namespace arapfields::python
