// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/jet_arrays.h"
#include "bindings/pickling.h"
#include "energies/arap.h"
#include "energies/body.h"
#include "energies/composed_energies.h"
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

/// A handle with what all kinds have in common.
template <class Kind>
Kind handle_of(Handle::Kind kind, double weight, double reach) {
  require_positive("weight", weight);
  require_not_negative("reach", reach);
  Kind handle;
  handle.kind = kind;
  handle.weight = weight;
  handle.reach = reach;
  return handle;
}

/// Sets the poses of a cuboid or region handle; InvalidInput where they give no motion.
void set_poses(Handle& handle, const ArrayArgument& rest, const ArrayArgument& target, bool allow_scale) {
  handle.allow_scale = allow_scale;
  handle.rest = as_matrix4(rest, "rest");
  handle.target = as_matrix4(target, "target");
  handle.motion();
}

void bind_handles(py::module_& module) {
  py::class_<Handle>(module, "Handle", R"(
A part of the surface that follows a rigid motion, or an affine one where it may scale; mesh coordinates.

A handle with a `reach`, a length, moves only what is within that distance of it, measured through the
interior of the shape. Beyond the reach of all such handles nothing moves at all. A handle without a reach
holds its part in place; if it moves too, it moves everything.)")
      .def_readonly("weight", &Handle::weight, "Factor of this handle's part of the loss.")
      .def_property_readonly(
          "motion", [](const Handle& self) { return self.motion(); },
          "(4, 4) motion rest → target: rigid, or affine with allow_scale.")
      .def_readonly("reach", &Handle::reach,
                    "Distance through the interior within which the handle moves the shape, in mesh units; "
                    "0: everything.")
      .def_readonly("allow_scale", &Handle::allow_scale, "Whether the target may be scaled or sheared.");
  py::class_<CuboidHandle, Handle>(module, "CuboidHandle", R"(
The surface inside a box.

`rest` and `target` (4, 4) map the cube [-1, 1]³ onto the box before and after. target·rest⁻¹ must be rigid;
with `allow_scale` it may be any affine map that neither flattens nor mirrors. A box that does not move holds
its part in place.)")
      .def(py::init([](const ArrayArgument& rest, const ArrayArgument& target, double weight,
                       bool allow_scale, double reach) {
             auto handle = handle_of<CuboidHandle>(Handle::Kind::cuboid, weight, reach);
             set_poses(handle, rest, target, allow_scale);
             return handle;
           }),
           "rest"_a, "target"_a, "weight"_a = 1.0, py::kw_only(), "allow_scale"_a = false, "reach"_a = 0.0)
      .def_property_readonly("rest", [](const CuboidHandle& self) { return self.rest; })
      .def_property_readonly("target", [](const CuboidHandle& self) { return self.target; });
  py::class_<PointHandle, Handle>(module, "PointHandle",
                                  "One material point, moved from `rest` (3,) to `target` (3,).")
      .def(py::init([](const ArrayArgument& rest, const ArrayArgument& target, double weight, double reach) {
             auto handle = handle_of<PointHandle>(Handle::Kind::point, weight, reach);
             handle.rest_point = as_vec3(rest, "rest");
             handle.target_point = as_vec3(target, "target");
             return handle;
           }),
           "rest"_a, "target"_a, "weight"_a = 1.0, py::kw_only(), "reach"_a = 0.0)
      .def_property_readonly("rest", [](const PointHandle& self) { return self.rest_point; })
      .def_property_readonly("target", [](const PointHandle& self) { return self.target_point; });
  py::class_<RegionHandle, Handle>(module, "RegionHandle", R"(
The listed samples (indices into the surface samples), moved by target·rest⁻¹.

`rest` and `target` are (4, 4). The motion must be rigid; with `allow_scale` it may be any affine map that
neither flattens nor mirrors.)")
      .def(py::init([](const ArrayArgument& samples, const ArrayArgument& rest, const ArrayArgument& target,
                       double weight, bool allow_scale, double reach) {
             auto handle = handle_of<RegionHandle>(Handle::Kind::region, weight, reach);
             handle.samples = as_indices(samples, "samples");
             for (const Index i : handle.samples)
               require(i >= 0, "samples", std::to_string(i), "indices from 0 on are allowed");
             set_poses(handle, rest, target, allow_scale);
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
      R"(
Agreement (n,) of unit normals (n, 3) with preferred normals (k, 3).

g = Σ_k w_k exp(sharpness n·n_k), with weights such that g(n_k) = 1; g is small far from all n_k. sharpness 0
stands for style_sharpness(preferred). Preferred normals that coincide raise InvalidInput, which names the
pair. Source: Kohlbrenner et al. 2021, "Gauss Stylization".)");
  module.def(
      "style_sharpness",
      [](const ArrayArgument& preferred) { return style_sharpness(as_points(preferred, "preferred")); },
      "preferred"_a,
      R"(
The sharpness, 5 to 25, at which neighbouring preferred normals (k, 3) overlap as the cube's do at 5.

Normals within 15 degrees of each other count as one curved face.)");
}

/// Calls energy(jets, cotangents) with zeroed cotangents: (value, …, cotangents).
template <class Scalar, class Energy>
py::tuple with_cotangents(JetArray<Scalar>& jets, Energy&& energy) {
  JetArray<Scalar> cotangents = zeros_like(jets);
  const auto value = energy(jet_view<const Scalar>(jets), jet_view<Scalar>(cotangents));
  if constexpr (std::is_same_v<std::remove_const_t<decltype(value)>, ArapValue>)
    return py::make_tuple(value.stretch, value.bend, cotangents);
  else
    return py::make_tuple(value, cotangents);
}

template <class Scalar>
void bind_testing(py::module_& module) {
  using Numbers = Eigen::VectorX<Scalar>;
  using Rows = PointsOf<Scalar>;
  module.def(
      "arap_energy",
      [](JetArray<Scalar> jets, double bending, double weight, bool composed) {
        return with_cotangents(jets, [&](auto view, auto out) {
          return (composed ? &probe_arap<Scalar> : &arap_energy<Scalar>)(view, bending, weight, out, {});
        });
      },
      "jets"_a.noconvert(), "bending"_a, "weight"_a = 1.0, "composed"_a = false);
  module.def(
      "arap_energy_by_points",
      [](JetArray<Scalar> jets, double bending, const Numbers& weights, const Numbers& bending_factors,
         bool composed) {
        return with_cotangents(jets, [&](auto view, auto out) {
          const auto energy = composed ? &probe_arap<Scalar> : &arap_energy<Scalar>;
          return energy(view, bending, 1.0, out, {weights.data(), bending_factors.data()}).energy;
        });
      },
      "jets"_a.noconvert(), "bending"_a, "weights"_a, "bending_factors"_a, "composed"_a = false);
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
      [](JetArray<Scalar> jets, const Rows& normals, const Points& preferred, double sharpness, double weight,
         const Numbers& sample_weights, bool composed) {
        return with_cotangents(jets, [&](auto view, auto out) {
          return (composed ? &probe_gauss<Scalar>
                           : &gauss_energy<Scalar>)(view, normals, sample_weights,
                                                    gauss_preference(preferred, sharpness), weight, out);
        });
      },
      "jets"_a.noconvert(), "normals"_a, "preferred"_a, "sharpness"_a, "weight"_a, "sample_weights"_a,
      "composed"_a = false);
  module.def(
      "target_energy",
      [](JetArray<Scalar> jets, const Rows& normals, const Rows& targets, double weight,
         const Numbers& sample_weights, bool composed) {
        return with_cotangents(jets, [&](auto view, auto out) {
          return (composed ? &probe_targets<Scalar> : &target_energy<Scalar>)(view, normals, targets,
                                                                              sample_weights, weight, out);
        });
      },
      "jets"_a.noconvert(), "normals"_a, "targets"_a, "weight"_a, "sample_weights"_a, "composed"_a = false);
  module.def(
      "handle_energy",
      [](JetArray<Scalar> jets, const BoundHandles& handles, double weight, bool composed) {
        return with_cotangents(jets, [&](auto view, auto out) {
          return (composed ? &probe_handles<Scalar> : &handle_energy<Scalar>)(view, handles.all<Scalar>(),
                                                                              weight, out);
        });
      },
      "jets"_a.noconvert(), "handles"_a, "weight"_a = 1.0, "composed"_a = false);
  module.def(
      "stance_energy",
      [](JetArray<Scalar> jets, const Rows& rest, const Stance& stance, double weight, bool composed) {
        return with_cotangents(jets, [&](auto view, auto out) {
          return (composed ? &probe_stance<Scalar> : &stance_energy<Scalar>)(view, rest, stance, weight, out);
        });
      },
      "jets"_a.noconvert(), "rest"_a, "stance"_a, "weight"_a = 1.0, "composed"_a = false);
  module.def(
      "body_energy",
      [](JetArray<Scalar> jets, const Points& rest, const Points& goal, const Vector& masses, double inertia,
         const Vector& gravity) {
        const Body<Scalar> body{masses.cast<Scalar>(), rest.cast<Scalar>(), goal.cast<Scalar>(), inertia,
                                gravity};
        return with_cotangents(jets, [&](auto view, auto out) { return body_energy(view, body, out).sum(); });
      },
      "jets"_a.noconvert(), "rest"_a, "goal"_a, "masses"_a, "inertia"_a, "gravity"_a);
  module.def(
      "fold_barrier",
      [](JetArray<Scalar> jets, double threshold, double weight, bool composed) {
        return with_cotangents(jets, [&](auto view, auto out) {
          return (composed ? &probe_barrier<Scalar> : &fold_barrier<Scalar>)(view, threshold, weight, out);
        });
      },
      "jets"_a.noconvert(), "threshold"_a, "weight"_a = 1.0, "composed"_a = false);
}

}  // namespace

void bind_energies(py::module_& module) {
  bind_handles(module);
  bind_styles(module);
  py::class_<Distortion>(
      module, "Distortion",
      "Determinants and stretches of a deformation over its samples: how far it is from folding.")
      .def_readonly("min_determinant", &Distortion::min_determinant, "Smallest det J.")
      .def_readonly("flipped_share", &Distortion::flipped_share, "Share of samples with det J ≤ 0.")
      .def_readonly("max_stretch", &Distortion::max_stretch, "Largest singular value of J.")
      .def_readonly("min_stretch", &Distortion::min_stretch, "Smallest singular value of J.")
      .def(py::pickle(
          [](const Distortion& self) {
            return py::make_tuple(self.min_determinant, self.flipped_share, self.max_stretch,
                                  self.min_stretch);
          },
          [](const py::tuple& parts) {
            const PickledState state(parts, "Distortion", 4);
            return Distortion{state.number(0), state.number(1), state.number(2), state.number(3)};
          }));

  py::module_ testing = testing_module(module);
  py::class_<BoundHandles>(testing, "BoundHandles")
      .def(py::init([](const std::vector<Handle>& handles, const Points& samples) {
        return BoundHandles(handles, samples);
      }))
      .def_property_readonly("sources", method(&BoundHandles::sources))
      .def_property_readonly("targets", method(&BoundHandles::targets))
      .def_property_readonly("members", method(&BoundHandles::members))
      .def("retarget", method(&BoundHandles::retarget))
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
  py::class_<ObjectStyle>(module, "ObjectStyle",
                          R"(
A style derived from a closed mesh: a map from directions to the mesh's normals.

A direction maps to the normal where the ray from the centroid leaves the mesh for the last time. A sphere is
the identity. Edges of less than 30 degrees count as smooth; across sharper edges the map is smoothed a
little.)")
      .def(py::init([](const ArrayArgument& vertices, const ArrayArgument& triangles, Task* task) {
             const TriangleMesh mesh = as_mesh(vertices, triangles);
             return run_long(task, [&](const Progress& progress) {
               return ObjectStyle(mesh.vertices, mesh.triangles, progress);
             });
           }),
           "vertices"_a, "triangles"_a, py::kw_only(), "task"_a = py::none(),
           R"(
vertices (n, 3), triangles (m, 3), all counter-clockwise seen from outside, or all clockwise.

InvalidInput for a broken, an open or a flat mesh.)")
      .def(
          "normals",
          [](const ObjectStyle& style, const ArrayArgument& directions, double smoothing) {
            Points d = as_points(directions, "directions");
            return run_long([&] { return style.normals(d, smoothing); });
          },
          "directions"_a, py::kw_only(), "smoothing"_a = double{ObjectStyle::usual_smoothing},
          R"(
The preferred unit normals (n, 3) for directions (n, 3).

`smoothing` is the angle, in radians from 0 to π/2, over which the map is smoothed. A direction whose ray
leaves no surface is kept.)")
      .def(
          "turned",
          [](const ObjectStyle& style, const ArrayArgument& orientation) {
            return style.turned(as_rotation(orientation, "orientation"));
          },
          "orientation"_a, "The object rotated by `orientation` (3, 3) about its centroid.")
      .def_property_readonly("centroid", method(&ObjectStyle::centroid),
                             "(3,) centroid of the solid, in mesh coordinates.")
      .def(py::pickle(
          [](const ObjectStyle& self) {
            return py::make_tuple(self.mesh().vertices, self.mesh().triangles, self.turn());
          },
          [](const py::tuple& parts) {
            const PickledState state(parts, "ObjectStyle", 3);
            const TriangleMesh mesh{state.points(0), as_triangles(state[1], state.name(1))};
            const Mat3 turn = as_rotation(state[2], state.name(2));
            return run_long([&] { return ObjectStyle(mesh.vertices, mesh.triangles).turned(turn); });
          }))
      .def("__repr__", [](const ObjectStyle&) { return "ObjectStyle()"; });
}

}  // namespace arapfields::python
