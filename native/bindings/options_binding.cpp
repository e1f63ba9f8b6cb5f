// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/options_binding.h"

namespace arapfields::python {
namespace {

std::string name_of_type(py::handle self) {
  return py::cast<std::string>(py::type::handle_of(self).attr("__name__"));
}

py::dict to_dict(py::handle self) {
  py::dict result;
  for (const auto& name : self.attr("fields")) result[name] = py::getattr(self, name);
  return result;
}

py::str shown(py::handle self) {
  std::string text;
  for (const auto& [name, value] : to_dict(self))
    text += (text.empty() ? "" : ", ") + py::cast<std::string>(name) + "=" +
            py::cast<std::string>(py::repr(value));
  return name_of_type(self) + "(" + text + ")";
}

bool equal(py::handle self, py::handle other) {
  return py::type::handle_of(self).is(py::type::handle_of(other)) && to_dict(self).equal(to_dict(other));
}

void bind_attribute(const py::object& cls, const std::string& type, const OptionAttribute& attribute) {
  const std::string self = "(self: arapfields._native." + type, hint = attribute.hint;
  const std::string label = type + "." + attribute.name;
  const py::cpp_function get([=](py::handle object) { return attribute.read(attribute.address(object)); },
                             py::is_method(cls), py::doc((self + ") -> " + hint).c_str()));
  const py::cpp_function set(
      [=](py::handle object, py::handle value) { attribute.write(attribute.address(object), value, label); },
      py::is_method(cls), py::doc((self + ", value: " + hint + ") -> None").c_str()));
  const py::object property = py::module_::import("builtins").attr("property");
  cls.attr(attribute.name) = property(get, set, py::none(), attribute.doc);
}

}  // namespace

void bind_attributes(py::object cls, const std::vector<OptionAttribute>& attributes) {
  py::options text;
  text.disable_function_signatures();
  const std::string type = py::cast<std::string>(cls.attr("__name__"));
  py::list fields;
  for (const OptionAttribute& attribute : attributes) {
    bind_attribute(cls, type, attribute);
    fields.append(attribute.name);
  }
  cls.attr("fields") = py::tuple(fields);
  const py::handle kind = cls;  // a class of ours lives as long as its module
  const auto mine = [kind](py::handle self) {
    if (!py::isinstance(self, kind))
      throw py::type_error("a method of " + py::cast<std::string>(kind.attr("__name__")) + ": got " +
                           py::cast<std::string>(py::str(py::type::handle_of(self))));
    return self;
  };
  const auto method = [&](const char* name, const auto& body, const char* doc) {
    cls.attr(name) = py::cpp_function(body, py::name(name), py::is_method(cls), py::doc(doc));
  };
  method(
      "to_dict", [mine](py::handle self) { return to_dict(mine(self)); },
      "to_dict(self) -> dict[str, typing.Any]\n\nThe options by name, in order.");
  method("__repr__", [mine](py::handle self) { return shown(mine(self)); }, "__repr__(self) -> str");
  cls.attr("__hash__") = py::none();
  method(
      "__eq__", [mine](py::handle self, py::handle other) { return equal(mine(self), other); },
      "__eq__(self, other: object) -> bool");
}

void bind_presets(py::object cls, const char* values, const char* doc) {
  py::options text;
  text.disable_function_signatures();
  const py::dict presets = py::module_::import("ast").attr("literal_eval")(values);
  const py::handle kind = cls;  // a class of ours lives as long as its module
  const py::cpp_function preset(
      [=](const std::string& name, const py::kwargs& changes) {
        if (!presets.contains(name))
          throw InvalidInput(py::cast<std::string>(kind.attr("__name__")), "unknown preset '" + name + "'",
                             "known are " + py::cast<std::string>(py::str(", ").attr("join")(presets)));
        py::object options = kind(**py::dict(presets[name.c_str()]));
        set_attributes(options, changes);
        return options;
      },
      py::name("preset"), py::doc(doc), py::arg("name"));
  cls.attr("preset") = py::module_::import("builtins").attr("staticmethod")(preset);
}

void set_attributes(py::handle self, const py::kwargs& given) {
  for (const auto& [key, value] : given) {
    const py::object property = py::getattr(py::type::handle_of(self), key, py::none());
    if (!py::hasattr(property, "fset"))
      throw InvalidInput(
          name_of_type(self), "unknown option '" + py::cast<std::string>(key) + "'",
          "known are " + py::cast<std::string>(py::str(", ").attr("join")(self.attr("fields"))));
    py::setattr(self, key, value);
  }
}

}  // namespace arapfields::python
