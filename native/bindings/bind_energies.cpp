// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arguments.h"
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/jet_arrays.h"
#include "energies/arap.h"
#include "energies/aten_probe.h"
#include "energies/body.h"
#include "energies/distortion.h"
#include "energies/gauss.h"
#include "energies/handles.h"
#include "energies/object_style.h"
#include "energies/rotation.h"
#include "energies/stance.h"
#include "energies/styles.h"

namespace arapfields::python {
namespace {

/// Python's three kinds of Handle, so that each has a constructor of its own.
struct CuboidHandle : Handle {};
struct PointHandle : Handle {};
struct RegionHandle : Handle {};

double checked_reach(double reach) {
  require_not_negative("reach", reach);
  return reach;
}

void bind_handles(py::module_& module) {
  py::class_<Handle>(
      module, "Handle",
      "A part of the surface asked to follow a rigid motion, or where it may scale, an affine\n"
      "map; mesh coordinates. With a `reach`, a length, it moves only what is no farther from what it "
      "holds,\n"
      "measured through the inside of the shape; beyond that of all handles that have one nothing\n"
      "moves at all. A handle without one then only holds: where it moves too, everything may.")
      .def_readonly("weight", &Handle::weight, "Factor of this handle's part of the loss.")
      .def_property_readonly(
          "motion", [](const Handle& self) { return self.motion(); },
          "(4, 4) motion rest → target: rigid, or affine with allow_scale.")
      .def_readonly("reach", &Handle::reach,
                    "How far it moves things, through the inside of the shape, in mesh units; 0: everything.")
      .def_readonly("allow_scale", &Handle::allow_scale,
                    "Whether targets may be larger, smaller, longer or sheared.");
  py::class_<CuboidHandle, Handle>(
      module, "CuboidHandle",
      "The surface inside a box. `rest` and `target` (4, 4) map the cube [-1, 1]³ onto the box before and\n"
      "after; target·rest⁻¹ must be rigid, unless `allow_scale` lets it be any affine map that neither\n"
      "flattens nor mirrors. A box that does not move holds its part in place.")
      .def(py::init([](const ArrayArgument& rest, const ArrayArgument& target, double weight,
                       bool allow_scale, double reach) {
             CuboidHandle handle;
             handle.allow_scale = allow_scale;
             handle.reach = checked_reach(reach);
             handle.rest = as_matrix4(rest, "rest");
             handle.target = as_matrix4(target, "target");
             handle.weight = weight;
             handle.motion();
             return handle;
           }),
           "rest"_a, "target"_a, "weight"_a = 1.0, py::kw_only(), "allow_scale"_a = false, "reach"_a = 0.0)
      .def_property_readonly("rest", [](const CuboidHandle& self) { return self.rest; })
      .def_property_readonly("target", [](const CuboidHandle& self) { return self.target; });
  py::class_<PointHandle, Handle>(module, "PointHandle",
                                  "One material point: `rest` (3,) is to arrive at `target` (3,).")
      .def(py::init([](const ArrayArgument& rest, const ArrayArgument& target, double weight, double reach) {
             PointHandle handle;
             handle.reach = checked_reach(reach);
             handle.kind = Handle::Kind::point;
             handle.rest_point = as_vec3(rest, "rest");
             handle.target_point = as_vec3(target, "target");
             handle.weight = weight;
             return handle;
           }),
           "rest"_a, "target"_a, "weight"_a = 1.0, py::kw_only(), "reach"_a = 0.0)
      .def_property_readonly("rest", [](const PointHandle& self) { return self.rest_point; })
      .def_property_readonly("target", [](const PointHandle& self) { return self.target_point; });
  py::class_<RegionHandle, Handle>(
      module, "RegionHandle",
      "The listed samples (indices into the surface samples), moved by target·rest⁻¹ (4, 4 each), which "
      "must\n"
      "be rigid unless `allow_scale` lets it be any affine map that neither flattens nor mirrors.")
      .def(py::init([](const ArrayArgument& samples, const ArrayArgument& rest, const ArrayArgument& target,
                       double weight, bool allow_scale, double reach) {
             RegionHandle handle;
             handle.allow_scale = allow_scale;
             handle.reach = checked_reach(reach);
             handle.kind = Handle::Kind::region;
             handle.samples = as_indices(samples, "samples");
             handle.rest = as_matrix4(rest, "rest");
             handle.target = as_matrix4(target, "target");
             handle.weight = weight;
             handle.motion();
             return handle;
           }),
           "samples"_a, "rest"_a, "target"_a, "weight"_a = 1.0, py::kw_only(), "allow_scale"_a = false,
           "reach"_a = 0.0)
      .def_property_readonly("samples", [](const RegionHandle& self) { return self.samples; })
      .def_property_readonly("rest", [](const RegionHandle& self) { return self.rest; })
      .def_property_readonly("target", [](const RegionHandle& self) { return self.target; });
}

void bind_styles(py::module_& module) {
  module.def("style_names", &style_names, "Names of the preset styles, in menu order.");
  module.def(
      "preferred_normals", [](const StyleArgument& name) { return preferred_normals(as_text(name, "name")); },
      "name"_a, "Unit face normals (k, 3) of a preset style's solid; its axis, where it has one, is z.");
  module.def(
      "gauss_preference",
      [](const ArrayArgument& normals, const ArrayArgument& preferred, double sharpness) {
        const Points directions = as_points(normals, "normals");
        return gauss_preference(as_points(preferred, "preferred"), sharpness).values(directions);
      },
      "normals"_a, "preferred"_a, py::kw_only(), "sharpness"_a = StylizeOptions().sharpness,
      "How much each unit normal (n, 3) agrees with the preferred normals (k, 3): (n,) values\n"
      "g = sum_k w_k exp(sharpness n·n_k) with g(n_k) = 1, small far from all of them. Coinciding preferred\n"
      "normals raise InvalidInput that names the pair. sharpness 0: style_sharpness(preferred). After\n"
      "Kohlbrenner et al., Gauss Stylization (2021).");
  module.def(
      "style_sharpness",
      [](const ArrayArgument& preferred) { return style_sharpness(as_points(preferred, "preferred")); },
      "preferred"_a,
      "The sharpness at which neighbours of the preferred normals (k, 3) overlap midway as the cube's do at "
      "5;\n"
      "from 5 to 25. Normals within 15 degrees of each other are one curved face.");
}

template <class Scalar>
void bind_testing(py::module_& module) {
  module.def(
      "arap_energy",
      [](JetArray<Scalar> jets, double bending, double weight, bool aten) {
        JetArray<Scalar> cotangents = zeros_like(jets);
        const auto energy = aten ? &probe_arap<Scalar> : &arap_energy<Scalar>;
        const ArapValue value =
            energy(jet_view<const Scalar>(jets), bending, weight, jet_view<Scalar>(cotangents), {});
        return py::make_tuple(value.stretch, value.bend, cotangents);
      },
      "jets"_a.noconvert(), "bending"_a, "weight"_a = 1.0, "aten"_a = false);
  module.def(
      "arap_energy_by_points",
      [](JetArray<Scalar> jets, double bending, const Eigen::VectorX<Scalar>& weights,
         const Eigen::VectorX<Scalar>& bending_factors, bool aten) {
        JetArray<Scalar> cotangents = zeros_like(jets);
        const auto energy = aten ? &probe_arap<Scalar> : &arap_energy<Scalar>;
        const ArapValue value =
            energy(jet_view<const Scalar>(jets), bending, 1.0, jet_view<Scalar>(cotangents),
                   {weights.data(), bending_factors.data()});
        return py::make_tuple(value.energy, cotangents);
      },
      "jets"_a.noconvert(), "bending"_a, "weights"_a, "bending_factors"_a, "aten"_a = false);
  module.def(
      "closest_rotations",
      [](JetArray<Scalar> jacobians) {
        JetArray<Scalar> rotations = zeros_like(jacobians);
        closest_rotations<Scalar>(jacobians.data(), jacobians.shape(1), rotations.mutable_data());
        return rotations;
      },
      "jacobians"_a.noconvert());
  module.def(
      "gauss_energy",
      [](JetArray<Scalar> jets, const PointsOf<Scalar>& normals, const Points& preferred, double sharpness,
         double weight, const Eigen::VectorX<Scalar>& sample_weights, bool aten) {
        JetArray<Scalar> cotangents = zeros_like(jets);
        const auto energy = aten ? &probe_gauss<Scalar> : &gauss_energy<Scalar>;
        const double value =
            energy(jet_view<const Scalar>(jets), normals, sample_weights,
                   gauss_preference(preferred, sharpness), weight, jet_view<Scalar>(cotangents));
        return py::make_tuple(value, cotangents);
      },
      "jets"_a.noconvert(), "normals"_a, "preferred"_a, "sharpness"_a, "weight"_a, "sample_weights"_a,
      "aten"_a = false);
  module.def(
      "target_energy",
      [](JetArray<Scalar> jets, const PointsOf<Scalar>& normals, const PointsOf<Scalar>& targets,
         double weight, const Eigen::VectorX<Scalar>& sample_weights, bool aten) {
        JetArray<Scalar> cotangents = zeros_like(jets);
        const auto energy = aten ? &probe_targets<Scalar> : &target_energy<Scalar>;
        const double value = energy(jet_view<const Scalar>(jets), normals, targets, sample_weights, weight,
                                    jet_view<Scalar>(cotangents));
        return py::make_tuple(value, cotangents);
      },
      "jets"_a.noconvert(), "normals"_a, "targets"_a, "weight"_a, "sample_weights"_a, "aten"_a = false);
  module.def(
      "handle_energy",
      [](JetArray<Scalar> jets, const BoundHandles& handles, double weight, bool aten) {
        JetArray<Scalar> cotangents = zeros_like(jets);
        const auto energy = aten ? &probe_handles<Scalar> : &handle_energy<Scalar>;
        const double value =
            energy(jet_view<const Scalar>(jets), handles.all<Scalar>(), weight, jet_view<Scalar>(cotangents));
        return py::make_tuple(value, cotangents);
      },
      "jets"_a.noconvert(), "handles"_a, "weight"_a = 1.0, "aten"_a = false);
  module.def(
      "stance_energy",
      [](JetArray<Scalar> jets, const PointsOf<Scalar>& rest, const Stance& stance, double weight,
         bool aten) {
        JetArray<Scalar> cotangents = zeros_like(jets);
        const auto energy = aten ? &probe_stance<Scalar> : &stance_energy<Scalar>;
        const double value =
            energy(jet_view<const Scalar>(jets), rest, stance, weight, jet_view<Scalar>(cotangents));
        return py::make_tuple(value, cotangents);
      },
      "jets"_a.noconvert(), "rest"_a, "stance"_a, "weight"_a = 1.0, "aten"_a = false);
  module.def(
      "body_energy",
      [](JetArray<Scalar> jets, const Points& rest, const Points& goal, const Vector& masses, double inertia,
         const Vector& gravity, const Vector& up, double ground, double ground_stiffness) {
        JetArray<Scalar> cotangents = zeros_like(jets);
        const Body<Scalar> body{
            masses.cast<Scalar>(), rest.cast<Scalar>(), goal.cast<Scalar>(), inertia, gravity, up, ground,
            ground_stiffness};
        const BodyEnergy energy =
            body_energy(jet_view<const Scalar>(jets), body, jet_view<Scalar>(cotangents));
        return py::make_tuple(energy.sum(), cotangents);
      },
      "jets"_a.noconvert(), "rest"_a, "goal"_a, "masses"_a, "inertia"_a, "gravity"_a, "up"_a, "ground"_a,
      "ground_stiffness"_a);
  module.def(
      "fold_barrier",
      [](JetArray<Scalar> jets, double threshold, double weight, bool aten) {
        JetArray<Scalar> cotangents = zeros_like(jets);
        const auto energy = aten ? &probe_barrier<Scalar> : &fold_barrier<Scalar>;
        const double value =
            energy(jet_view<const Scalar>(jets), threshold, weight, jet_view<Scalar>(cotangents));
        return py::make_tuple(value, cotangents);
      },
      "jets"_a.noconvert(), "threshold"_a, "weight"_a = 1.0, "aten"_a = false);
}

}  // namespace

void bind_energies(py::module_& module) {
  bind_handles(module);
  bind_styles(module);
  py::class_<Distortion>(module, "Distortion", "How far a deformation is from a fold, over its samples.")
      .def_readonly("min_determinant", &Distortion::min_determinant, "Smallest det J.")
      .def_readonly("flipped_share", &Distortion::flipped_share, "Share of samples with det J ≤ 0.")
      .def_readonly("max_stretch", &Distortion::max_stretch, "Largest singular value of J.")
      .def_readonly("min_stretch", &Distortion::min_stretch, "Smallest singular value of J.");

  py::module_ testing = testing_module(module);
  py::class_<BoundHandles>(testing, "BoundHandles")
      .def(py::init([](const std::vector<Handle>& handles, const Points& samples) {
        return BoundHandles(handles, samples);
      }))
      .def_property_readonly("sources", &BoundHandles::sources)
      .def_property_readonly("targets", &BoundHandles::targets)
      .def_property_readonly("members", &BoundHandles::members)
      .def("retarget", &BoundHandles::retarget)
      .def("error", [](const BoundHandles& self, const Points& values) {
        const HandleError error = handle_error(self, values);
        return py::make_tuple(error.mean, error.max);
      });
  py::class_<Stance>(testing, "Stance")
      .def(py::init(
          [](const Points& points, const py::object& up) { return Stance::of(points, as_vec3(up, "up")); }))
      .def_readonly("up", &Stance::up)
      .def_readonly("scale", &Stance::scale)
      .def_readonly("ground", &Stance::ground);
  testing.def("gauss_weights", [](const Points& normals, double sharpness) {
    const GaussPreference preference = gauss_preference(normals, sharpness);
    return py::make_tuple(preference.normals, preference.weights);
  });
  testing.def("distortion",
              [](JetArray<double> jets) { return distortion<double>(jet_view<const double>(jets)); });
  bind_testing<double>(testing);
  bind_testing<float>(testing);
}

void bind_object_style(py::module_& module) {
  py::class_<ObjectStyle>(
      module, "ObjectStyle",
      "A style read off a closed mesh: normals turn to what the object has in their direction, its normal\n"
      "where the ray from its centroid leaves it for the last time. A sphere changes nothing. What is bent "
      "by\n"
      "less than 30 degrees from triangle to triangle counts as smooth; across sharper edges the map is\n"
      "smoothed a little.")
      .def(py::init([](const ArrayArgument& vertices, const ArrayArgument& triangles, Task* task) {
             const Points v = as_points(vertices, "vertices");
             const Triangles f = as_triangles(triangles, "triangles");
             return run_long(task, [&](const Progress& progress) { return ObjectStyle(v, f, progress); });
           }),
           "vertices"_a, "triangles"_a, py::kw_only(), "task"_a = py::none(),
           "vertices (n, 3), triangles (m, 3), counter-clockwise seen from outside, or all the other way "
           "round.\n"
           "InvalidInput for a broken mesh, an open one, and one that is flat.")
      .def(
          "normals",
          [](const ObjectStyle& style, const ArrayArgument& directions, double smoothing) {
            Points d = as_points(directions, "directions");
            return run_long(nullptr, [&](const Progress&) { return style.normals(d, smoothing); });
          },
          "directions"_a, py::kw_only(), "smoothing"_a = ObjectStyle::usual_smoothing,
          "What the object asks of directions (n, 3): unit normals (n, 3). `smoothing`, in radians: over "
          "what\n"
          "angle the map is smoothed, 0 to a right angle. Directions in which nothing is left are kept.")
      .def(
          "turned",
          [](const ObjectStyle& style, const ArrayArgument& orientation) {
            return style.turned(as_rotation(orientation, "orientation"));
          },
          "orientation"_a, "The same object after the rotation (3, 3) about its centroid.")
      .def_property_readonly("centroid", &ObjectStyle::centroid,
                             "(3,) of the solid, in the mesh's coordinates.")
      .def("__repr__", [](const ObjectStyle&) { return "ObjectStyle()"; });
}

}  // namespace arapfields::python
