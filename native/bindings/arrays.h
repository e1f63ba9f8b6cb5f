// SPDX-License-Identifier: GPL-3.0-or-later
// Types of arguments and results, and the conversion of Python's arrays and sequences.
#pragma once

#include <functional>
#include <vector>

#include "bindings/bind.h"
#include "mesh/triangle_mesh.h"

// Argument and result types that Python's type checkers see, where pybind11 alone would say object.

namespace arapfields::python {

inline bool is_any(PyObject*) { return true; }

}  // namespace arapfields::python

/// An object, taken or returned as it is, that signatures and stubs show as `hint`.
#define ARAPFIELDS_PYTHON_TYPE(Name, hint)                                \
  namespace arapfields::python {                                          \
  class Name : public pybind11::object {                                  \
   public:                                                                \
    PYBIND11_OBJECT_DEFAULT(Name, pybind11::object, is_any)               \
  };                                                                      \
  }                                                                       \
  template <>                                                             \
  struct pybind11::detail::handle_type_name<::arapfields::python::Name> { \
    static constexpr auto name = pybind11::detail::const_name(hint);      \
  };

// Arguments, converted by as_points() and its kin (arrays.h).
ARAPFIELDS_PYTHON_TYPE(ArrayArgument, "arapfields.arrays.ArrayLike")
ARAPFIELDS_PYTHON_TYPE(PointsArgument, "numpy.typing.NDArray[numpy.float64]")
ARAPFIELDS_PYTHON_TYPE(ArraysArgument, "collections.abc.Iterable[arapfields.arrays.ArrayLike]")
ARAPFIELDS_PYTHON_TYPE(ColumnsArgument, "collections.abc.Iterable[numpy.typing.NDArray[numpy.float32]]")
ARAPFIELDS_PYTHON_TYPE(
    MeshesArgument,
    "collections.abc.Iterable[tuple[arapfields.arrays.ArrayLike, arapfields.arrays.ArrayLike]]")
ARAPFIELDS_PYTHON_TYPE(OptionalArraysArgument, "collections.abc.Iterable[arapfields.arrays.ArrayLike | None]")
ARAPFIELDS_PYTHON_TYPE(NormalsArgument,
                       "arapfields.arrays.ArrayLike | arapfields._native.ObjectStyle | "
                       "arapfields._native.StyleName")
ARAPFIELDS_PYTHON_TYPE(StyleArgument, "arapfields._native.StyleName")
ARAPFIELDS_PYTHON_TYPE(HandlesArgument, "collections.abc.Iterable[arapfields._native.Handle]")
ARAPFIELDS_PYTHON_TYPE(BonesArgument, "collections.abc.Iterable[arapfields._native.Bone]")
ARAPFIELDS_PYTHON_TYPE(ObstaclesArgument, "collections.abc.Iterable[arapfields._native.Obstacle]")
ARAPFIELDS_PYTHON_TYPE(ShapeArgument,
                       "tuple[arapfields.arrays.ArrayLike, arapfields.arrays.ArrayLike] | "
                       "arapfields._native.SurfaceSamples")
ARAPFIELDS_PYTHON_TYPE(MeshArgument, "tuple[arapfields.arrays.ArrayLike, arapfields.arrays.ArrayLike]")
ARAPFIELDS_PYTHON_TYPE(MovedArgument, "arapfields._native.DeformationField | arapfields.arrays.ArrayLike")
ARAPFIELDS_PYTHON_TYPE(TransferArgument, "dict[str, arapfields.arrays.ArrayLike]")
ARAPFIELDS_PYTHON_TYPE(CurveHandlesArgument, "collections.abc.Iterable[arapfields._native.CurveHandle]")
ARAPFIELDS_PYTHON_TYPE(
    LandmarksArgument,
    "collections.abc.Iterable[tuple[arapfields.arrays.ArrayLike, arapfields.arrays.ArrayLike]]")
ARAPFIELDS_PYTHON_TYPE(PathArgument, "str | bytes | os.PathLike[str] | os.PathLike[bytes]")
ARAPFIELDS_PYTHON_TYPE(CallbackArgument, "collections.abc.Callable[[arapfields.reports.Iteration], object]")
ARAPFIELDS_PYTHON_TYPE(EnergiesArgument,
                       "collections.abc.Iterable[collections.abc.Callable[[arapfields.energies.Jets], "
                       "arapfields.energies.EnergyValue]]")
ARAPFIELDS_PYTHON_TYPE(FunctionArgument, "arapfields._native.ImplicitFunction")

// Results: fields and meshes with what was measured on the way.
ARAPFIELDS_PYTHON_TYPE(TransferResult, "dict[str, numpy.typing.NDArray[numpy.float64]]")
ARAPFIELDS_PYTHON_TYPE(SurfaceSamplesResult, "arapfields._native.SurfaceSamples")
ARAPFIELDS_PYTHON_TYPE(NeuralSdfResult, "arapfields._native.NeuralSdf")
ARAPFIELDS_PYTHON_TYPE(FieldResult, "arapfields._native.DeformationField[arapfields.reports.SolveReport]")
ARAPFIELDS_PYTHON_TYPE(RadialFieldResult, "arapfields._native.RadialField")
ARAPFIELDS_PYTHON_TYPE(WrapResult, "arapfields._native.DeformationField[arapfields.reports.WrapReport]")
ARAPFIELDS_PYTHON_TYPE(InverseResult, "arapfields._native.DeformationField[arapfields.reports.InverseReport]")
ARAPFIELDS_PYTHON_TYPE(ExtractionResult, "arapfields.reports.Extraction[arapfields.reports.ExtractionReport]")
ARAPFIELDS_PYTHON_TYPE(DeformedExtractionResult,
                       "arapfields.reports.Extraction[arapfields.reports.DeformedExtractionReport]")
ARAPFIELDS_PYTHON_TYPE(FitReportResult, "arapfields.reports.FitReport")
ARAPFIELDS_PYTHON_TYPE(FieldReportResult, "ReportT")
ARAPFIELDS_PYTHON_TYPE(LiveReportResult, "arapfields.reports.LiveReport")
ARAPFIELDS_PYTHON_TYPE(SampleReportResult, "arapfields.reports.SampleReport")

namespace arapfields::python {

// Accepted are NumPy arrays, objects with the buffer protocol, DLPack (other libraries' tensors, also those
// that require a gradient) or __array__, and nested sequences. Points take integer and float dtypes;
// triangles and indices take integers alone. InvalidInput names `argument` for another shape or dtype, and
// where memory is short.
Points as_points(const py::handle& value, const std::string& argument);
/// The same, refusing NaN and infinity.
Points as_finite_points(const py::handle& value, const std::string& argument);
/// The arguments `vertices` and `triangles`, not yet validated.
TriangleMesh as_mesh(const py::handle& vertices, const py::handle& triangles);
/// A pair of both.
TriangleMesh as_mesh_pair(const py::handle& value, const std::string& argument,
                          const std::string& allowed = "a pair (vertices, triangles) is needed");
Triangles as_triangles(const py::handle& value, const std::string& argument);
Vector as_vector(const py::handle& value, const std::string& argument);
/// The same; empty for an argument that was not given.
template <class Argument>
Vector as_vector(const std::optional<Argument>& value, const std::string& argument) {
  return value ? as_vector(*value, argument) : Vector();
}
Mat4 as_matrix4(const py::handle& value, const std::string& argument);
/// (3,3), orthogonal to 1e-4.
Mat3 as_rotation(const py::handle& value, const std::string& argument);
Vec3 as_vec3(const py::handle& value, const std::string& argument);
/// Any real array as (rows, cols) doubles.
Eigen::MatrixXd as_matrix(const py::handle& value, const std::string& argument);
/// Integers of shape (n,).
std::vector<Index> as_indices(const py::handle& value, const std::string& argument);
/// Real numbers of any shape, contiguous.
py::array_t<double> as_doubles(const py::handle& value, const std::string& argument);

std::string type_text(const py::handle& value);
/// A str; InvalidInput for anything else.
std::string as_text(const py::handle& value, const std::string& argument);

/// Calls take(item, "argument[i]") for the items of anything iterable. InvalidInput where it is not, or where
/// its length times `item_bytes` is more than there is memory for.
void for_each_item(const py::handle& value, const std::string& argument, const std::string& allowed,
                   double item_bytes, const std::function<void(const py::object&, const std::string&)>& take);

/// The items of anything iterable, of one bound class. InvalidInput names the one that is of another.
template <class Item>
std::vector<Item> as_items(const py::handle& value, const std::string& argument, const std::string& allowed) {
  std::vector<Item> items;
  for_each_item(value, argument, allowed, sizeof(Item), [&](const py::object& item, const std::string& name) {
    require(py::isinstance<Item>(item), name, "got " + type_text(item), allowed);
    items.push_back(item.cast<const Item&>());
  });
  return items;
}

/// Shared ownership of a Python object; the last owner may be on any thread and takes the GIL to release it.
std::shared_ptr<py::object> kept_alive(py::object object);

}  // namespace arapfields::python
