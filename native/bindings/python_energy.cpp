// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/arrays.h"
#include "bindings/python_function.h"

namespace arapfields::python {
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
