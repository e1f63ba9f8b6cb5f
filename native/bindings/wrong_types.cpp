// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/wrong_types.h"

#include <string>
#include <unordered_map>
#include <vector>

#include "bindings/arrays.h"

namespace arapfields::python {
namespace {

using py::detail::function_call;
using py::detail::function_record;

/// What pybind11 calls for each function, which tells what does not fit by a result of its own.
std::unordered_map<const function_record*, py::handle (*)(function_call&)>& implementations() {
  static std::unordered_map<const function_record*, py::handle (*)(function_call&)> all;
  return all;
}

/// The hint of the argument in "(self: A, name: B | None = None) -> C".
std::string hint_of(const std::string& signature, const std::string& name) {
  for (const char* before : {"(", ", "}) {
    const std::size_t at = signature.find(before + name + ": ");
    if (at == signature.npos) continue;
    const std::size_t begin = signature.find(": ", at) + 2;
    int depth = 0;
    for (std::size_t end = begin; end < signature.size(); ++end) {
      const char c = signature[end];
      if (depth == 0 && (c == ',' || c == ')' || signature.compare(end, 3, " = ") == 0))
        return signature.substr(begin, end - begin);
      depth += (c == '[' || c == '(') - (c == ']' || c == ')');
    }
  }
  return {};
}

bool converts(PyObject* made) {
  Py_XDECREF(made);
  PyErr_Clear();
  return made != nullptr;
}

/// One of the hints that are joined by " | ": whether the value fits, and how it reads.
bool fits(const std::string& hint, const py::handle& value, std::string& wanted) {
  const auto is = [&](const char* words, bool fitting) {
    if (wanted.find(words) == wanted.npos) wanted += (wanted.empty() ? "" : " or ") + std::string(words);
    return fitting;
  };
  if (hint == "None") return is("None", value.is_none());
  if (hint.find("SupportsFloat") != hint.npos || hint == "float")
    return is("a number", converts(PyNumber_Float(value.ptr())) && !PyUnicode_Check(value.ptr()) &&
                              !PyBytes_Check(value.ptr()));
  if (hint.find("SupportsInt") != hint.npos || hint == "int")
    return is("an integer", !PyFloat_Check(value.ptr()) && !PyUnicode_Check(value.ptr()) &&
                                !PyBytes_Check(value.ptr()) && converts(PyNumber_Long(value.ptr())));
  if (hint.find("SupportsIndex") != hint.npos) return converts(PyNumber_Index(value.ptr()));
  if (hint == "bool") return is("True or False", PyBool_Check(value.ptr()));
  if (hint == "str") return is("a text", PyUnicode_Check(value.ptr()) || PyBytes_Check(value.ptr()));
  const std::string ours = "arapfields._native.";
  if (!hint.starts_with(ours)) return true;
  const std::string name = hint.substr(ours.size());
  const py::object type = py::getattr(py::module_::import("arapfields._native"), name.c_str(), py::none());
  return !PyType_Check(type.ptr()) || is(name.c_str(), py::isinstance(value, type));
}

void require_fitting(const std::string& name, const std::string& hint, const py::handle& value) {
  std::string wanted;
  bool fitting = hint.empty();
  for (std::size_t begin = 0; begin <= hint.size() && !fitting;) {
    const std::size_t end = std::min(hint.find(" | ", begin), hint.size());
    fitting = fits(hint.substr(begin, end - begin), value, wanted);
    begin = end + 3;
  }
  const bool integer = wanted.find("an integer") != wanted.npos;
  const bool large = fitting && integer && PyLong_Check(value.ptr()) &&
                     (py::int_(py::reinterpret_borrow<py::object>(value)) > py::int_(INT32_MAX) ||
                      py::int_(py::reinterpret_borrow<py::object>(value)) < py::int_(0));
  if (fitting && !large) return;
  const std::string found =
      large ? py::cast<std::string>(py::str(value)).substr(0, 40) : "got " + type_text(value);
  const std::string allowed = large ? "it is out of range" : wanted + " is needed";
  const py::object type = py::module_::import("arapfields._native").attr("_WrongType");
  PyErr_SetObject(type.ptr(), py::str(name + ": " + found + "; " + allowed).ptr());
  throw py::error_already_set();
}

py::handle call_naming(function_call& call) {
  py::handle result = PYBIND11_TRY_NEXT_OVERLOAD;
  if (call.func.is_method && call.args.size() > 0 && call.args[0].is_none())  // a null pointer to a member
    require_fitting("self", hint_of(call.func.signature, "self"), call.args[0]);
  try {
    result = implementations().at(&call.func)(call);
  } catch (const py::reference_cast_error&) {  // None where an object is needed
  }
  if (result.ptr() != PYBIND11_TRY_NEXT_OVERLOAD) return result;
  const std::string signature = call.func.signature;
  const std::size_t first = call.func.is_new_style_constructor ? 1 : 0;  // before it: no object yet
  for (std::size_t i = first; i < call.args.size() && i < call.func.args.size(); ++i) {
    const py::detail::argument_record& argument = call.func.args[i];
    if (argument.name != nullptr && !call.args[i].is(argument.value))
      require_fitting(argument.name, hint_of(signature, argument.name), call.args[i]);
  }
  return result;
}

_PyCFunctionFastWithKeywords dispatcher = nullptr;  // of pybind11, the same for all functions

/// What is wrong with how many arguments there are, or with their names; "" where that is right.
std::string misfit(const function_record& function, std::size_t given, const py::tuple& named) {
  if (function.has_args || function.has_kwargs) return {};
  std::string known, missing;
  for (std::size_t i = function.is_method ? 1 : 0; i < function.nargs; ++i) {
    const bool has_record = i < function.args.size() && function.args[i].name != nullptr;
    const std::string name = has_record ? function.args[i].name : "argument";
    const bool is_named = named.contains(name), is_given = i < given && i < function.nargs_pos;
    if (is_named && is_given) return name + ": is given twice";
    const bool is_needed = !has_record || !function.args[i].value;
    if (!is_named && !is_given && is_needed && missing.empty()) missing = name + ": is missing";
    known += (known.empty() ? "" : ", ") + name;
  }
  const std::string takes = std::string(function.name) + "() takes " + (known.empty() ? "nothing" : known);
  for (const py::handle name : named) {
    const std::string text = py::cast<std::string>(py::str(name));
    if ((", " + known + ", ").find(", " + text + ", ") == known.npos)
      return text + ": there is no such argument; " + takes;
  }
  if (given > function.nargs_pos) return "arguments: there are too many; " + takes;
  return missing;
}

/// As pybind11 alone, but for calls of which it only lists the whole signature.
PyObject* dispatch_naming(PyObject* self, PyObject* const* given, Py_ssize_t count, PyObject* names) {
  PyObject* const result = dispatcher(self, given, count, names);
  if (result != nullptr || PyErr_Occurred() != PyExc_TypeError) return result;
  py::error_already_set error;
  try {
    const py::tuple named = names ? py::reinterpret_borrow<py::tuple>(names) : py::tuple();
    const auto positional = static_cast<std::size_t>(PyVectorcall_NARGS(static_cast<std::size_t>(count)));
    const std::string what = misfit(*py::detail::function_record_ptr_from_PyObject(self), positional, named);
    if (!what.empty()) {
      const py::object type = py::module_::import("arapfields._native").attr("_WrongType");
      PyErr_SetObject(type.ptr(), py::str(what).ptr());
      return nullptr;
    }
  } catch (py::error_already_set&) {  // the error at hand says more
  }
  error.restore();
  return nullptr;
}

void watch(const py::handle& bound) {
  const py::handle function = py::detail::get_function(bound);
  if (!function || !PyCFunction_Check(function.ptr())) return;
  const py::handle self = PyCFunction_GET_SELF(function.ptr());
  if (!self) return;
  function_record* record = py::detail::function_record_ptr_from_PyObject(self.ptr());
  if (record == nullptr || record->next != nullptr || record->is_operator) return;
  if (!implementations().try_emplace(record, record->impl).second) return;
  record->impl = &call_naming;
  dispatcher = reinterpret_cast<_PyCFunctionFastWithKeywords>(reinterpret_cast<void*>(record->def->ml_meth));
  record->def->ml_meth = reinterpret_cast<PyCFunction>(reinterpret_cast<void*>(&dispatch_naming));
}

void watch_all(const py::handle& members) {
  for (const auto& [name, value] : py::dict(py::reinterpret_borrow<py::object>(members))) {
    const py::object object = py::reinterpret_borrow<py::object>(value);
    if (PyType_Check(value.ptr())) continue;
    if (py::hasattr(object, "fget")) {
      for (const char* accessor : {"fget", "fset"})
        if (const py::object one = object.attr(accessor); !one.is_none()) watch(one);
    } else {
      watch(PyObject_TypeCheck(value.ptr(), &PyStaticMethod_Type) ? object.attr("__func__") : object);
    }
  }
}

}  // namespace

void name_wrong_types(const py::module_& module) {
  const py::object kind = py::module_::import("builtins").attr("type");
  const py::object invalid = module.attr("InvalidInput");
  py::dict about;
  about["__module__"] = invalid.attr("__module__");
  about["__qualname__"] = "InvalidInput";  // as users see it; it is caught as a TypeError, too
  about["__doc__"] = invalid.attr("__doc__");
  module.attr("_WrongType") = kind(
      "InvalidInput", py::make_tuple(invalid, py::reinterpret_borrow<py::object>(PyExc_TypeError)), about);
  const py::dict members = module.attr("__dict__");
  watch_all(members);
  for (const auto& [name, value] : members)
    if (PyType_Check(value.ptr()) && py::hasattr(value, "__dict__"))
      watch_all(py::dict(value.attr("__dict__")));
}

}  // namespace arapfields::python
