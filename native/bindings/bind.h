// SPDX-License-Identifier: GPL-3.0-or-later
// What every bind_<folder>.cpp shares.
#pragma once

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "bindings/run_long.h"
#include "core/errors.h"
#include "core/task.h"
#include "core/types.h"

namespace arapfields::python {

namespace py = pybind11;
using namespace pybind11::literals;

/// NumPy input → our arrays. Shapes and dtypes that do not fit raise InvalidInput naming `argument`;
/// (real) integer and float dtypes are accepted for points, integers alone for triangles.
Points as_points(const py::handle& value, const std::string& argument);
Triangles as_triangles(const py::handle& value, const std::string& argument);
Vector as_vector(const py::handle& value, const std::string& argument);
Mat4 as_matrix4(const py::handle& value, const std::string& argument);
Vec3 as_vec3(const py::handle& value, const std::string& argument);
/// Any real array as (rows, cols) doubles.
Eigen::MatrixXd as_matrix(const py::handle& value, const std::string& argument);

/// Binds a struct of options: keyword-only constructor with the struct's own defaults, read-write fields,
/// repr, equality, `to_dict()`. An unknown keyword raises InvalidInput that lists what exists.
template <class Options>
class OptionsBinding {
 public:
  OptionsBinding(py::module_& module, const char* name, const char* doc)
      : class_(module, name, doc), name_(name) {
    fields_ = py::list();
    class_.attr("fields") = fields_;
    const std::string type_name = name_;
    class_.def(py::init([type_name](const py::kwargs& given) {
      Options options;
      py::object self = py::cast(&options, py::return_value_policy::reference);
      const py::object known = py::type::of(self).attr("fields");
      for (const auto& [key, value] : given) {
        const std::string field = py::cast<std::string>(key);
        require(py::cast<bool>(known.attr("__contains__")(key)), type_name, "unknown option '" + field + "'",
                "known are " + py::cast<std::string>(py::str(", ").attr("join")(known)));
        py::setattr(self, field.c_str(), value);
      }
      return options;
    }));
    class_.def("to_dict", &OptionsBinding::to_dict, "The options as a dict, in the order of `fields`.");
    class_.def("__repr__", [type_name](const py::object& self) {
      std::string text;
      for (const auto& [key, value] : to_dict(self))
        text += (text.empty() ? "" : ", ") + py::cast<std::string>(key) + "=" +
                py::cast<std::string>(py::repr(value));
      return type_name + "(" + text + ")";
    });
    class_.def("__eq__", [](const py::object& self, const py::object& other) {
      return py::type::of(self).is(py::type::of(other)) && to_dict(self).equal(to_dict(other));
    });
  }

  template <class Field>
  OptionsBinding& field(const char* name, Field Options::* member, const char* doc) {
    const std::string label = std::string(name_) + "." + name;
    class_.def_property(
        name, [member](const Options& self) { return self.*member; },
        [member, label](Options& self, const py::object& value) {
          try {
            self.*member = py::cast<Field>(value);
          } catch (const py::cast_error&) {
            throw InvalidInput(
                label, "got " + py::cast<std::string>(py::repr(value)),
                std::string("expected ") + (std::is_same_v<Field, bool>          ? "True or False"
                                            : std::is_integral_v<Field>          ? "an integer"
                                            : std::is_floating_point_v<Field>    ? "a number"
                                            : std::is_same_v<Field, std::string> ? "a string"
                                                                                 : "another type"));
          }
        },
        doc);
    fields_.append(name);
    return *this;
  }

 private:
  static py::dict to_dict(const py::object& self) {
    py::dict result;
    for (const auto& name : py::type::of(self).attr("fields")) result[name] = py::getattr(self, name);
    return result;
  }

  py::class_<Options> class_;
  std::string name_;
  py::list fields_;
};

void bind_core(py::module_& module);
void bind_mesh(py::module_& module);
void bind_distance(py::module_& module);
void bind_neural(py::module_& module);
void bind_sampling(py::module_& module);
void bind_fit(py::module_& module);
void bind_fields(py::module_& module);
void bind_energies(py::module_& module);
void bind_solve(py::module_& module);
void bind_extraction(py::module_& module);
void bind_live(py::module_& module);
void bind_curves(py::module_& module);
void bind_solve_testing(py::module_& module);

}  // namespace arapfields::python
