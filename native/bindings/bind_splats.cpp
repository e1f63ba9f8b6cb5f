// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "bindings/arrays.h"
#include "bindings/bind.h"
#include "bindings/files.h"
#include "core/parallel.h"
#include "io/splat_file.h"
#include "io/splat_gltf.h"
#include "splats/gaussian_splats.h"
#include "splats/move_splats.h"
#include "splats/sample_splats.h"

namespace arapfields::python {
namespace {

RowMatrix<float> as_columns(const ArrayArgument& given, const std::string& name, Index columns) {
  const Eigen::MatrixXd read = as_matrix(given, name);
  require(read.cols() == columns, name, "another shape", "(n, " + std::to_string(columns) + ") is needed");
  return read.cast<float>();
}

GaussianSplats make(const ArrayArgument& centers, const ArrayArgument& rotations, const ArrayArgument& scales,
                    const ArrayArgument& opacities, const ArrayArgument& harmonics) {
  GaussianSplats splats;
  splats.centers = as_columns(centers, "centers", 3);
  splats.rotations = as_columns(rotations, "rotations", 4);
  const Eigen::MatrixXd widths = as_columns(scales, "scales", 3).cast<double>();
  require(widths.allFinite() && (widths.array() > 0.0).all(), "scales", "0, negative or not finite",
          "standard deviations above 0 are needed");
  splats.log_scales = widths.array().log().cast<float>();
  const Vector alpha = as_vector(opacities, "opacities");
  require((alpha.array() >= 0.0).all() && (alpha.array() <= 1.0).all(), "opacities", "outside of [0, 1]",
          "numbers from 0 to 1 are needed");
  splats.opacity_logits = (alpha.array() / (1.0 - alpha.array())).log().cast<float>();
  const py::array_t<double> colours = as_doubles(harmonics, "harmonics");
  require(colours.ndim() == 3 && colours.shape(2) == 3, "harmonics", "another shape", "(n, k, 3) is needed");
  splats.harmonics =
      Eigen::Map<const RowMatrix<double>>(colours.data(), colours.shape(0), 3 * colours.shape(1))
          .cast<float>();
  splats.other_values.resize(splats.size(), 0);
  splats.validate();
  splats.rotations.rowwise().normalize();
  return splats;
}

using FloatArray = py::array_t<float>;
/// What a call without the GIL holds on to, so that nobody takes its memory away (memory_of).
using Kept = std::shared_ptr<GaussianSplats>;

/// The place and the stride of (n) single-precision numbers.
std::pair<float*, Index> as_column(const py::object& given, const std::string& name, Index count,
                                   bool written) {
  const std::string needed = "(" + std::to_string(count) + ",) float32 numbers are needed";
  require(py::isinstance<py::array>(given), name, "got " + type_text(given), needed);
  auto array = py::reinterpret_borrow<py::array>(given);
  require(array.dtype().is(py::dtype::of<float>()) && array.ndim() == 1 && array.shape(0) == count, name,
          "another type or shape", needed);
  const auto place = reinterpret_cast<std::uintptr_t>(array.data());
  require(array.strides(0) % Index{sizeof(float)} == 0 && place % alignof(float) == 0, name, "unaligned",
          needed);
  require(!written || array.writeable(), name, "it cannot be written to", needed);
  return {static_cast<float*>(const_cast<void*>(array.data())), array.strides(0) / Index{sizeof(float)}};
}

PointsF changes_of(const PreparedSplats& self, const DeformationField& field, const ColumnsArgument& rest,
                   const ColumnsArgument& changes, Task* task) {
  std::vector<SplatColumn> columns;
  std::vector<py::object> held;  // an iterable may make its arrays on the way
  const auto item_bytes = static_cast<double>(sizeof(SplatColumn));
  for_each_item(rest, "rest", "a sequence of arrays is needed", item_bytes,
                [&](const py::object& item, const std::string& name) {
                  const auto [data, stride] = as_column(item, name, self.rest().size(), false);
                  held.push_back(item);
                  columns.push_back({data, stride, nullptr, 0});
                });
  const auto needed = static_cast<std::size_t>(4 + self.rest().harmonics.cols());
  require(columns.size() == needed, "rest", std::to_string(columns.size()) + " arrays",
          std::to_string(needed) + " are needed");
  std::size_t written = 0;
  for_each_item(changes, "changes", "a sequence of arrays is needed", item_bytes,
                [&](const py::object& item, const std::string& name) {
                  const auto [data, stride] = as_column(item, name, self.rest().size(), true);
                  held.push_back(item);
                  if (written < needed)
                    columns[written].change = data, columns[written].change_stride = stride;
                  ++written;
                });
  require(written == needed, "changes", std::to_string(written) + " arrays",
          std::to_string(needed) + " are needed");
  return run_long(task, [&](const Progress& progress) { return self.changes(field, columns, progress); });
}

/// The memory of splats that no call is at work on; they are empty afterwards. The GIL is held.
GaussianSplats memory_of(const Kept& into) {
  if (into == nullptr) return {};
  constexpr long owners = 2;  // Python's object and the argument
  require(into.use_count() == owners, "into", "another call is at work on it",
          "splats of a call that is over are needed");
  return std::exchange(*into, {});
}

}  // namespace

void bind_splats(py::module_& module) {
  py::class_<GaussianSplats, std::shared_ptr<GaussianSplats>>(module, "GaussianSplats", R"(
Gaussian splats: anisotropic Gaussians with opacity and view-dependent colour, in the scan's coordinates.

Arrays are float32 and new each time.)")
      .def(py::init(&make), "centers"_a, "rotations"_a, "scales"_a, "opacities"_a, "harmonics"_a, R"(
centers (n, 3); rotations (n, 4), unit quaternions (w, x, y, z); scales (n, 3), standard deviations along their
axes; opacities (n,) from 0 to 1; harmonics (n, k, 3), colours of k = 1, 4, 9 or 16 real spherical harmonics.
InvalidInput for other shapes and values.)")
      .def("__len__", method(&GaussianSplats::size))
      .def("__repr__",
           [](const GaussianSplats& self) {
             return "GaussianSplats(" + std::to_string(self.size()) + " splats, " +
                    std::to_string(self.harmonics.cols() / 3) + " harmonics)";
           })
      .def_property_readonly(
          "centers", [](const GaussianSplats& self) { return PointsF(self.centers); }, "(n, 3)")
      .def_property_readonly(
          "rotations", [](const GaussianSplats& self) { return RowMatrix<float>(self.rotations); },
          "(n, 4) unit quaternions (w, x, y, z).")
      .def_property_readonly(
          "scales", [](const GaussianSplats& self) { return PointsF(self.log_scales.array().exp()); },
          "(n, 3) standard deviations along the axes.")
      .def_property_readonly(
          "opacities",
          [](const GaussianSplats& self) {
            return VectorF(1.0f / (1.0f + (-self.opacity_logits.array()).exp()));
          },
          "(n,) from 0 to 1.")
      .def_property_readonly(
          "harmonics",
          [](const GaussianSplats& self) {
            FloatArray result({self.size(), Index{self.harmonics.cols() / 3}, Index{3}});
            std::copy_n(self.harmonics.data(), self.harmonics.size(), result.mutable_data());
            return result;
          },
          "(n, k, 3) colours of the real spherical harmonics.")
      .def(
          "save",
          [](const Kept& self, const PathArgument& path, Task* task) {
            const std::string place = as_path(path);
            run_long(task, [&](const Progress& progress) { save_splats(place, *self, progress); });
          },
          "path"_a, py::kw_only(), "task"_a = py::none(),
          "Writes a binary PLY file in the common layout, in whole or not at all. OSError where the system "
          "refuses.")
      .def(
          "save_gltf",
          [](const Kept& self, const PathArgument& path, const std::string& name, const std::string& up,
             Task* task) {
            const std::string place = as_path(path);
            require(up == "y" || up == "z", "up", up, "\"y\" or \"z\" is needed");
            run_long(task, [&](const Progress& progress) {
              save_splats_gltf(place, *self, name, up == "z", progress);
            });
          },
          "path"_a, "name"_a = "Splats", py::kw_only(), "up"_a = "y", "task"_a = py::none(), R"(
Writes a binary glTF file (.glb) with the extension KHR_gaussian_splatting, in whole or not at all.

`up`: the splats' axis that is up, "y" or "z"; glTF's is y, and those of z are turned. `name`: that of the object
in it. OSError where the system refuses.)")
      .def(
          "transformed",
          [](const Kept& self, const ArrayArgument& matrix, Task* task) {
            const Mat4 motion = as_matrix4(matrix, "matrix");
            return run_long(
                task, [&](const Progress& progress) { return transform_splats(*self, motion, progress); });
          },
          "matrix"_a, py::kw_only(), "task"_a = py::none(), R"(
The splats under an affine map (4, 4) that mirrors nothing: centers, covariances A Σ Aᵀ, and colours turned by the
rotation closest to A. InvalidInput for other matrices.)")
      .def_static(
          "load",
          [](const PathArgument& path, Task* task) {
            const std::string place = as_path(path);
            return run_long(task, [&](const Progress& progress) { return load_splats(place, progress); });
          },
          "path"_a, py::kw_only(), "task"_a = py::none(), R"(
Splats of a binary PLY file in the common layout: x, y, z, f_dc_*, f_rest_*, opacity, scale_*, rot_*.

Other properties are kept, and saved again. OSError for a file that cannot be read; InvalidInput, naming the
file, for one that is damaged or laid out otherwise.)")
      .def_static(
          "is_file", [](const PathArgument& path) { return is_splat_file(as_path(path)); }, "path"_a,
          "Whether a file's header has the layout that load() reads; False where it cannot be read.");
  module.def(
      "sample_splats",
      [](const Kept& splats, Index count, Task* task) {
        return run_long(task,
                        [&](const Progress& progress) { return sample_splats(*splats, count, progress); });
      },
      "splats"_a.none(false), "count"_a = 20000, py::kw_only(), "task"_a = py::none(), R"(
SurfaceSamples of what splats show: at most `count` centers of opaque splats, spread evenly.

Normals are the shortest axes, turned outward (Hoppe et al. 1992). Parts with less than 1 % of the samples are
left out. Raises InvalidInput and Cancelled.)");
  py::class_<PreparedSplats, std::shared_ptr<PreparedSplats>>(module, "PreparedSplats", R"(
GaussianSplats that are moved again and again, as in a live session.

The first radial field prepares what it needs at the centers; those of the same live session find it there.
They are moved in single precision: errors are some 1e-5 of the size.)")
      .def(py::init([](const Kept& splats) {
             const py::gil_scoped_release others_run;
             return std::make_shared<PreparedSplats>(*splats);
           }),
           "splats"_a.none(false), "InvalidInput for splats that do not fit together.")
      .def("__len__", [](const PreparedSplats& self) { return self.rest().size(); })
      .def_property_readonly(
          "rest",
          [](const std::shared_ptr<PreparedSplats>& self) {
            return Kept(self, const_cast<GaussianSplats*>(&self->rest()));  // Python changes none
          },
          "GaussianSplats at rest.")
      .def(
          "moved",
          [](const PreparedSplats& self, const DeformationField& field, const Kept& into, double max_stretch,
             Task* task) {
            GaussianSplats memory = memory_of(into);
            return run_long(task, [&](const Progress& progress) {
              return self.moved(field, max_stretch, progress, std::move(memory));
            });
          },
          "field"_a, "into"_a = py::none(), py::kw_only(), "max_stretch"_a = default_max_stretch,
          "task"_a = py::none(), R"(
As field.apply_to(splats). May be called from any thread. Raises InvalidInput and Cancelled.

`into`: splats of an earlier call that are no longer needed. The result takes their memory; they are empty then.)")
      .def("changes", &changes_of, "field"_a, "rest"_a, "changes"_a, py::kw_only(), "task"_a = py::none(), R"(
The centers (n, 3) of moved(field, max_stretch=math.inf); what else the motion changes goes to `changes`.

`rest`: the splats' numbers at rest, 4 + 3k float32 arrays (n,) of any stride: rotations (w, x, y, z), logarithms of
the scales, then all harmonics but the first, channel by channel. `changes`: as many arrays, which become what is
added to each. May be called from any thread. Raises InvalidInput and Cancelled.)");
  auto field = py::reinterpret_borrow<py::class_<DeformationField, std::shared_ptr<DeformationField>>>(
      module.attr("DeformationField"));
  field.def(
      "apply_to",
      [](const DeformationField& self, const Kept& splats, double max_stretch, Task* task) {
        return run_long(task, [&](const Progress& progress) {
          return move_splats(self, *splats, max_stretch, progress);
        });
      },
      "splats"_a.none(false), py::kw_only(), "max_stretch"_a = default_max_stretch, "task"_a = py::none(), R"(
GaussianSplats moved by the field: f(μ), J Σ Jᵀ, and colours turned by the rotation closest to J.

Gaussians that the field stretches by more than `max_stretch` along an axis, or bends, are divided first; the new
ones come last. math.inf divides none. Raises InvalidInput and Cancelled.)");
}

}  // namespace arapfields::python
