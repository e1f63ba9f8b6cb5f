// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/python_function.h"

#include "bindings/arguments.h"
#include "bindings/arrays.h"

namespace arapfields::python {
namespace {

/// Half the distance of the points of central differences, in cube units: sampling and extraction work in
/// single precision, for whose functions less would be noise.
constexpr double difference_step = 1e-3;

Vector values_at(const py::object& self, const Points& points) {
  const Vector values = as_vector(self(points), "sdf");
  require(values.size() == points.rows(), "sdf",
          std::to_string(values.size()) + " values for " + std::to_string(points.rows()) + " points",
          "one number a point is needed");
  return values;
}

/// Central differences, by one call.
Points differences(const py::object& self, const Points& points, double step) {
  const Index n = points.rows();
  Points shifted = points.replicate(6, 1);
  for (int axis = 0; axis < 3; ++axis) {
    shifted.col(axis).segment(2 * axis * n, n).array() += step;
    shifted.col(axis).segment((2 * axis + 1) * n, n).array() -= step;
  }
  const Vector values = values_at(self, shifted);
  Points gradients(n, 3);
  for (int axis = 0; axis < 3; ++axis)
    gradients.col(axis) =
        (values.segment(2 * axis * n, n) - values.segment((2 * axis + 1) * n, n)) / (2.0 * step);
  return gradients;
}

Points gradients_at(const py::object& self, const Points& points) {
  const Points gradients = as_points(self.attr("gradient")(points), "sdf");
  require(gradients.rows() == points.rows(), "sdf",
          std::to_string(gradients.rows()) + " gradients for " + std::to_string(points.rows()) + " points",
          "one a point is needed");
  return gradients;
}

Vector no_values(const py::object& self, const PointsArgument&) {
  self.cast<const ImplicitFunction&>();  // TypeError for what __new__ alone has made
  PyErr_Format(PyExc_NotImplementedError,
               "%s has no __call__(points): a subclass of ImplicitFunction needs one",
               Py_TYPE(self.ptr())->tp_name);
  throw py::error_already_set();
}

Points base_gradient(const py::object& self, const PointsArgument& points) {
  const Points where = as_points(points, "points");
  require(where.allFinite(), "points", "some coordinates are NaN or infinite", "all must be finite");
  return differences(self, where, difference_step * self.cast<const ImplicitFunction&>().frame().scale);
}

}  // namespace

void PythonFunction::evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values) const {
  const std::lock_guard only(one_at_a_time_);
  const py::gil_scoped_acquire acquire;
  const py::object self =
      py::cast(static_cast<const ImplicitFunction*>(this), py::return_value_policy::reference);
  values = (values_at(self, frame_.to_mesh(points.cast<double>())) / frame_.scale).cast<float>();
}

void PythonFunction::evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values,
                              Eigen::Ref<PointsF> gradients) const {
  const std::lock_guard only(one_at_a_time_);
  const py::gil_scoped_acquire acquire;
  const py::object self =
      py::cast(static_cast<const ImplicitFunction*>(this), py::return_value_policy::reference);
  const Points mesh = frame_.to_mesh(points.cast<double>());
  values = (values_at(self, mesh) / frame_.scale).cast<float>();
  gradients = gradients_at(self, mesh).cast<float>();
}

std::optional<double> PythonFunction::gradient_bound() const {
  const std::lock_guard only(one_at_a_time_);
  const py::gil_scoped_acquire acquire;
  const py::object self =
      py::cast(static_cast<const ImplicitFunction*>(this), py::return_value_policy::reference);
  const py::object bound = self.attr("gradient_bound");
  if (bound.is_none()) return std::nullopt;
  const py::array_t<double> number = as_doubles(bound, "sdf.gradient_bound");
  require(number.size() == 1 && *number.data() > 0.0 && std::isfinite(*number.data()), "sdf.gradient_bound",
          py::cast<std::string>(py::repr(bound)), "a positive number is needed, or None");
  return *number.data();
}

bool PythonFunction::continuous() const {
  const std::lock_guard only(one_at_a_time_);
  const py::gil_scoped_acquire acquire;
  const py::object self =
      py::cast(static_cast<const ImplicitFunction*>(this), py::return_value_policy::reference);
  const py::object said = self.attr("continuous");
  require(py::isinstance<py::bool_>(said), "sdf.continuous", py::cast<std::string>(py::repr(said)),
          "True or False is needed");
  return said.cast<bool>();
}

std::shared_ptr<const ImplicitFunction> as_function(const py::object& given, const std::string& argument) {
  require(py::isinstance<ImplicitFunction>(given), argument, "got " + type_text(given),
          "an ImplicitFunction is needed, such as a NeuralSdf, a MeshSdf or a subclass of your own");
  return {kept_alive(given), &given.cast<const ImplicitFunction&>()};
}

void bind_implicit(py::module_& module) {
  py::class_<ImplicitFunction, PythonFunction, std::shared_ptr<ImplicitFunction>>(
      module, "ImplicitFunction",
      "A function of space whose zero set is a surface, negative inside; mesh coordinates and units.\n\n"
      "A subclass defines __call__(points), (p, 3) → (p,), and may define gradient(points), (p, 3) → (p, "
      "3);\n"
      "without it there are central differences. `frame` is the cube in which the surface is looked for: "
      "the\n"
      "unit cube, or what was given to __init__. Calls come one at a time, in batches of some thousand\n"
      "points, up to a thousandth outside the cube; what they raise comes through. Serves sample_surface,\n"
      "extract_surface, extract_deformed and sdf_grid.")
      .def(py::init(
               [](const std::optional<Frame>& frame) { return new PythonFunction(frame.value_or(Frame{})); }),
           "frame"_a = py::none())
      .def("__call__", &no_values, "points"_a, "Values (p,) at points (p, 3), negative inside.")
      .def(
          "gradient", &base_gradient, "points"_a,
          "Derivatives (p, 3) of the values by the points, by central differences over 0.002 of the frame's\n"
          "scale.")
      .def_property_readonly(
          "gradient_bound",
          [](const ImplicitFunction& self) {
            return dynamic_cast<const PythonFunction*>(&self) != nullptr ? std::nullopt
                                                                         : self.gradient_bound();
          },
          "A bound on the gradient's length that holds everywhere in the cube, where one is known (1 for a\n"
          "distance), or None: it is then measured. A subclass may set it.")
      .def_property_readonly(
          "continuous",
          [](const ImplicitFunction& self) {
            return dynamic_cast<const PythonFunction*>(&self) != nullptr || self.continuous();
          },
          "Whether it is continuous. Where it jumps from one sign to the other there is no surface, and\n"
          "extraction leaves the mesh open. A subclass may set it to False.")
      .def_property_readonly("frame", &ImplicitFunction::frame, "Mesh coordinates and the unit cube.");
}

}  // namespace arapfields::python
