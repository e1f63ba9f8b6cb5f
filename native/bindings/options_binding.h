// SPDX-License-Identifier: GPL-3.0-or-later
// Python classes of option structs, for the code that native/options/generate.py writes.
#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <vector>

#include "core/errors.h"
#include "options/choices.h"

namespace arapfields::python {

namespace py = pybind11;

/// How one attribute is read and written. Everything that does not depend on the struct is compiled once.
struct OptionAttribute {
  const char* name;
  const char* hint;  ///< its type in Python's words
  const char* doc;
  void* (*address)(py::handle self);  ///< of the member in the object
  py::object (*read)(const void* member);
  void (*write)(void* member, py::handle value, const std::string& label);  ///< InvalidInput names the label
};

template <class Field>
py::object read_option(const void* member) {
  if constexpr (std::is_enum_v<Field>)
    return py::str(name_of(*static_cast<const Field*>(member)));
  else
    return py::cast(*static_cast<const Field*>(member));
}

template <class Field>
void write_option(void* member, py::handle value, const std::string& label) {
  Field& target = *static_cast<Field*>(member);
  const char* expected = "expected a string";
  if constexpr (std::is_arithmetic_v<Field>)
    expected = std::is_same_v<Field, bool> ? "expected True or False"
               : std::is_integral_v<Field> ? "expected an integer"
                                           : "expected a number";
  try {
    if constexpr (std::is_enum_v<Field>)
      choose(py::cast<std::string>(value), label, target);
    else
      target = py::cast<Field>(value);
  } catch (const py::cast_error&) {
    throw InvalidInput(label, "got " + py::cast<std::string>(py::repr(value)), expected);
  }
}

/// Adds attributes, `fields`, `to_dict()`, repr and equality to a class whose constructor takes keywords.
void bind_attributes(py::object cls, const std::vector<OptionAttribute>& attributes);
/// Adds the static method preset(): the options of a name in `values`, a Python literal {name: {option:
/// value}}.
void bind_presets(py::object cls, const char* values, const char* doc);
/// Sets the attributes that the keywords name. An unknown keyword raises InvalidInput that lists what exists.
void set_attributes(py::handle self, const py::kwargs& given);

/// Binds a struct of options: keyword-only constructor with the struct's own defaults and read-write
/// attributes. `signature` is the constructor's, so that stubs know each keyword and its type.
template <class Options>
py::object bind_struct(py::module_& module, const char* name, const char* about, const char* signature,
                       const std::vector<OptionAttribute>& attributes) {
  py::class_<Options> bound(module, name, about);
  py::options text;
  text.disable_function_signatures();
  bound.def(py::init([](const py::kwargs& given) {
              Options options;
              set_attributes(py::cast(&options, py::return_value_policy::reference), given);
              return options;
            }),
            signature);
  bind_attributes(bound, attributes);
  return bound;
}

}  // namespace arapfields::python
