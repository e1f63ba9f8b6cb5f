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
  return differences(self, as_finite_points(points, "points"),
                     difference_step * self.cast<const ImplicitFunction&>().frame().scale);
}

}  // namespace

template <class Call>
auto PythonFunction::locked(Call&& call) const {
  const std::lock_guard only(mutex_);
  const py::gil_scoped_acquire acquire;
  return call(py::cast(static_cast<const ImplicitFunction*>(this), py::return_value_policy::reference));
}

void PythonFunction::evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values) const {
  locked([&](const py::object& self) {
    values = (values_at(self, frame_.to_mesh(points.cast<double>())) / frame_.scale).cast<float>();
  });
}

void PythonFunction::evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values,
                              Eigen::Ref<PointsF> gradients) const {
  locked([&](const py::object& self) {
    const Points mesh = frame_.to_mesh(points.cast<double>());
    values = (values_at(self, mesh) / frame_.scale).cast<float>();
    gradients = gradients_at(self, mesh).cast<float>();
  });
}

std::optional<double> PythonFunction::gradient_bound() const {
  return locked([](const py::object& self) -> std::optional<double> {
    const py::object bound = self.attr("gradient_bound");
    if (bound.is_none()) return std::nullopt;
    const py::array_t<double> number = as_doubles(bound, "sdf.gradient_bound");
    require(number.size() == 1 && *number.data() > 0.0 && std::isfinite(*number.data()), "sdf.gradient_bound",
            py::cast<std::string>(py::repr(bound)), "a positive number is needed, or None");
    return *number.data();
  });
}

bool PythonFunction::continuous() const {
  return locked([](const py::object& self) {
    const py::object value = self.attr("continuous");
    require(py::isinstance<py::bool_>(value), "sdf.continuous", py::cast<std::string>(py::repr(value)),
            "True or False is needed");
    return value.cast<bool>();
  });
}

std::shared_ptr<const ImplicitFunction> as_function(const py::object& object, const std::string& argument) {
  require(py::isinstance<ImplicitFunction>(object), argument, "got " + type_text(object),
          "an ImplicitFunction is needed, such as a NeuralSdf, a MeshSdf or a subclass of your own");
  return {kept_alive(object), &object.cast<const ImplicitFunction&>()};
}

void bind_implicit(py::module_& module) {
  py::class_<ImplicitFunction, PythonFunction, std::shared_ptr<ImplicitFunction>>(module, "ImplicitFunction",
                                                                                  R"(
A function of space whose zero set is a surface, negative inside; mesh coordinates and units.

A subclass defines __call__(points), (p, 3) → (p,), and may define gradient(points), (p, 3) → (p, 3). Without
gradient there are central differences. `frame` is the cube searched for the surface: the unit cube unless
__init__ receives one. Calls come one at a time, in batches of some thousand points, up to a thousandth
outside the cube; exceptions propagate. Serves sample_surface, extract_surface, extract_deformed and
sdf_grid.)")
      .def(py::init(
               [](const std::optional<Frame>& frame) { return new PythonFunction(frame.value_or(Frame{})); }),
           "frame"_a = py::none())
      .def("__call__", &no_values, "points"_a, "Values (p,) at points (p, 3), negative inside.")
      .def("gradient", &base_gradient, "points"_a,
           R"(
Gradients (p, 3) of the values, by central differences over 0.002 of the frame's scale.)")
      .def_property_readonly(
          "gradient_bound",
          [](const ImplicitFunction& self) {
            return dynamic_cast<const PythonFunction*>(&self) != nullptr ? std::nullopt
                                                                         : self.gradient_bound();
          },
          R"(
A bound on the gradient's length over the cube, 1 for a distance; None where it is unknown and gets measured.

A subclass may set it.)")
      .def_property_readonly(
          "continuous",
          [](const ImplicitFunction& self) {
            return dynamic_cast<const PythonFunction*>(&self) != nullptr || self.continuous();
          },
          R"(
Whether the function is continuous. A subclass may set it to False.

Where the function jumps from one sign to the other there is no surface, and extraction leaves the mesh open.)")
      .def_property_readonly("frame", &ImplicitFunction::frame, "The Frame of the unit cube.");
}

}  // namespace arapfields::python
