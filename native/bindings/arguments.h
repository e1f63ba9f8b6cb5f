// SPDX-License-Identifier: GPL-3.0-or-later
// Argument and result types that Python's type checkers see, where pybind11 alone would say object.
#pragma once

#include <pybind11/pybind11.h>

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
