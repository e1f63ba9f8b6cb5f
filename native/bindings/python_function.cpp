// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/python_function.h"

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
      .def_property_readonly("frame", method(&ImplicitFunction::frame), "The Frame of the unit cube.");
}

namespace {

using Array = py::array_t<double>;

/// Jets of the unit cube as arrays of mesh coordinates, and cotangents of those arrays back.
class PythonEnergy final : public ExternalEnergy {
 public:
  PythonEnergy(const py::object& call, std::string name, const Frame& frame)
      : call_(kept_alive(call)), name_(std::move(name)), frame_(frame) {
    const py::object order = py::getattr(call, "order", py::int_(1));
    require(order.equal(py::int_(1)) || order.equal(py::int_(2)), name_ + ".order",
            py::cast<std::string>(py::repr(order)), "1 and 2 are allowed");
    order_ = order.equal(py::int_(2)) ? JetOrder::second : JetOrder::first;
  }
  JetOrder order() const override { return order_; }

  double evaluate(PointsIn points, const JetView<const double>& jets,
                  const JetView<double>& cotangents) override {
    const py::gil_scoped_acquire acquire;
    const py::object type = py::module_::import("arapfields.energies").attr("Jets");
    const py::object returned =
        (*call_)(type(frame_.to_mesh(points), values(jets), jacobians(jets), hessians(jets)));
    const std::string allowed = "an EnergyValue is needed, or a tuple like it";
    require(py::isinstance<py::tuple>(returned), name_, "it returned " + type_text(returned), allowed);
    const auto parts = py::reinterpret_borrow<py::tuple>(returned);
    require(parts.size() >= 1 && parts.size() <= 4, name_,
            "it returned a tuple of " + std::to_string(parts.size()), allowed);
    add_values(parts, jets.count, cotangents);
    add_jacobians(parts, jets.count, cotangents);
    add_hessians(parts, jets.count, cotangents);
    const Array value = as_doubles(parts[0], name_ + ": value");
    require(value.size() == 1, name_, "its value is " + std::to_string(value.size()) + " numbers",
            "one is needed");
    return *value.data();
  }

 private:
  Points values(const JetView<const double>& jets) const {
    return frame_.to_mesh(Eigen::Map<const Points>(jets.data, jets.count, 3));
  }

  static Array jacobians(const JetView<const double>& jets) {
    Array result({jets.count, Index{3}, Index{3}});
    auto entry = result.mutable_unchecked<3>();
    for (Index p = 0; p < jets.count; ++p)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) entry(p, i, j) = jets.at(first_column(j), p)[i];
    return result;
  }

  py::object hessians(const JetView<const double>& jets) const {
    if (order_ != JetOrder::second) return py::none();
    Array result({jets.count, Index{3}, Index{3}, Index{3}});
    auto entry = result.mutable_unchecked<4>();
    for (Index p = 0; p < jets.count; ++p)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          for (int k = 0; k < 3; ++k) entry(p, i, j, k) = jets.at(second_column(j, k), p)[i] / frame_.scale;
    return result;
  }

  /// The derivatives at this place of what was returned, of the shape (n, 3, …); nothing where it is None.
  std::optional<Array> part(const py::tuple& parts, std::size_t place, const char* label, Index count) const {
    if (place >= parts.size() || parts[place].is_none()) return std::nullopt;
    const std::string argument = name_ + ": " + label;
    Array given = as_doubles(parts[place], argument);
    bool fits = given.ndim() == static_cast<py::ssize_t>(place + 1) && given.shape(0) == count;
    for (py::ssize_t axis = 1; fits && axis < given.ndim(); ++axis) fits = given.shape(axis) == 3;
    std::string expected_shape = "(" + std::to_string(count);
    for (std::size_t axis = 0; axis < place; ++axis) expected_shape += ", 3";
    require(fits, argument, "shape " + py::cast<std::string>(py::str(given.attr("shape"))),
            "derivatives of shape " + expected_shape + ") are needed");
    return given;
  }

  void add_values(const py::tuple& parts, Index count, const JetView<double>& out) const {
    const std::optional<Array> given = part(parts, 1, "values", count);
    if (!given) return;
    Eigen::Map<Points>(out.data, count, 3) +=
        frame_.scale * Eigen::Map<const Points>(given->data(), count, 3);
  }

  void add_jacobians(const py::tuple& parts, Index count, const JetView<double>& out) const {
    const std::optional<Array> given = part(parts, 2, "jacobians", count);
    if (!given) return;
    const auto entry = given->unchecked<3>();
    for (Index p = 0; p < count; ++p)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) out.at(first_column(j), p)[i] += entry(p, i, j);
  }

  void add_hessians(const py::tuple& parts, Index count, const JetView<double>& out) const {
    const std::optional<Array> given = part(parts, 3, "hessians", count);
    if (!given) return;
    require(order_ == JetOrder::second, name_, "derivatives by hessians, and its order is 1",
            "an energy of order 2 may have them");
    const auto entry = given->unchecked<4>();
    for (Index p = 0; p < count; ++p)
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          for (int k = 0; k < 3; ++k) out.at(second_column(j, k), p)[i] += entry(p, i, j, k) / frame_.scale;
  }

  std::shared_ptr<py::object> call_;
  std::string name_;
  Frame frame_;
  JetOrder order_ = JetOrder::first;
};

}  // namespace

ExternalEnergies as_energies(const py::object& energies, const Frame& frame) {
  ExternalEnergies result;
  const std::string allowed = "functions of arapfields.Jets are needed";
  for_each_item(energies, "energies", allowed, sizeof(PythonEnergy),
                [&](const py::object& energy, const std::string& name) {
                  require(PyCallable_Check(energy.ptr()) != 0 && !PyType_Check(energy.ptr()), name,
                          "got " + type_text(energy), allowed);
                  result.push_back(std::make_shared<PythonEnergy>(energy, name, frame));
                });
  return result;
}

}  // namespace arapfields::python
