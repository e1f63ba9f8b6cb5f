// SPDX-License-Identifier: GPL-3.0-or-later
// What a thread does that calls Python where the interpreter has ended.
//
// Python up to 3.13 ends a daemon thread by pthread_exit as soon as it asks for Python's lock, which any code
// in Python does now and then. With glibc that unwinds the thread's C++ frames: destructors that ask for the
// lock in their turn abort the process, and those that drop Python's objects do so without the lock. So no
// call of this module lets it through: the thread stops where it is, as Python 3.14 has it do, and the
// process ends without it. The linker puts these functions in the places of Python's own (--wrap), in
// pybind11 too; CMakeLists.txt takes their names from here. NumPy's functions, which let the lock go while
// they copy, are called through pybind11's table of them, and stop there likewise.
#include "bindings/bind.h"

#if defined(__linux__)

#include <Python.h>
#include <cxxabi.h>
#include <pybind11/numpy.h>

#include <chrono>
#include <thread>

namespace {

template <class Call>
auto or_stop(Call&& call) {
  try {
    return call();
  } catch (const abi::__forced_unwind&) {
    while (true) std::this_thread::sleep_for(std::chrono::hours(1));
  }
}

using NumpyTable = pybind11::detail::npy_api;

/// Replaces a function in the table by one that stops.
template <auto member>
struct InTable;
template <class Result, class... Given, Result (*NumpyTable::*member)(Given...)>
struct InTable<member> {
  static inline Result (*real)(Given...) = nullptr;
  static Result call(Given... given) {
    return or_stop([&] { return real(given...); });
  }
  static void put(NumpyTable& table) {
    if (table.*member == &call) return;
    real = table.*member;
    table.*member = &call;
  }
};

}  // namespace

namespace arapfields::python {

void stop_in_numpy() {
  NumpyTable& table = NumpyTable::get();
  InTable<&NumpyTable::PyArray_CopyInto_>::put(table);
  InTable<&NumpyTable::PyArray_FromAny_>::put(table);
  InTable<&NumpyTable::PyArray_NewCopy_>::put(table);
  InTable<&NumpyTable::PyArray_NewFromDescr_>::put(table);
  InTable<&NumpyTable::PyArray_Newshape_>::put(table);
  InTable<&NumpyTable::PyArray_Resize_>::put(table);
}

}  // namespace arapfields::python

// clang-format off
#define STOPPING(result, name, parameters, arguments)            \
  extern "C" result __real_##name parameters;                    \
  extern "C" result __wrap_##name parameters {                   \
    return or_stop([&] { return __real_##name arguments; });     \
  }

STOPPING(void, PyEval_RestoreThread, (PyThreadState* state), (state))
STOPPING(void, PyEval_AcquireThread, (PyThreadState* state), (state))
STOPPING(PyGILState_STATE, PyGILState_Ensure, (), ())
STOPPING(PyObject*, PyObject_Call, (PyObject* one, PyObject* given, PyObject* named), (one, given, named))
STOPPING(PyObject*, PyObject_CallObject, (PyObject* one, PyObject* given), (one, given))
STOPPING(PyObject*, PyObject_Vectorcall, (PyObject* one, PyObject* const* given, size_t count, PyObject* names),
         (one, given, count, names))
STOPPING(PyObject*, PyImport_ImportModule, (const char* name), (name))
STOPPING(PyObject*, PyObject_GetAttr, (PyObject* one, PyObject* name), (one, name))
STOPPING(PyObject*, PyObject_GetAttrString, (PyObject* one, const char* name), (one, name))
STOPPING(int, PyObject_HasAttrString, (PyObject* one, const char* name), (one, name))
STOPPING(int, PyObject_SetAttr, (PyObject* one, PyObject* name, PyObject* value), (one, name, value))
STOPPING(int, PyObject_SetAttrString, (PyObject* one, const char* name, PyObject* value), (one, name, value))
STOPPING(PyObject*, PyObject_GetItem, (PyObject* one, PyObject* key), (one, key))
STOPPING(int, PyObject_SetItem, (PyObject* one, PyObject* key, PyObject* value), (one, key, value))
STOPPING(PyObject*, PyObject_GetIter, (PyObject* one), (one))
STOPPING(PyObject*, PyIter_Next, (PyObject* one), (one))
STOPPING(Py_ssize_t, PyObject_Size, (PyObject* one), (one))
STOPPING(Py_ssize_t, PyObject_LengthHint, (PyObject* one, Py_ssize_t otherwise), (one, otherwise))
STOPPING(PyObject*, PyObject_Str, (PyObject* one), (one))
STOPPING(PyObject*, PyObject_Repr, (PyObject* one), (one))
STOPPING(int, PyObject_RichCompareBool, (PyObject* one, PyObject* other, int kind), (one, other, kind))
STOPPING(int, PyObject_IsInstance, (PyObject* one, PyObject* type), (one, type))
STOPPING(PyObject*, PySequence_GetItem, (PyObject* one, Py_ssize_t place), (one, place))
STOPPING(Py_ssize_t, PySequence_Size, (PyObject* one), (one))
STOPPING(PyObject*, PySequence_Tuple, (PyObject* one), (one))
STOPPING(PyObject*, PyNumber_Float, (PyObject* one), (one))
STOPPING(PyObject*, PyNumber_Index, (PyObject* one), (one))
STOPPING(PyObject*, PyNumber_Long, (PyObject* one), (one))
STOPPING(PyObject*, PyNumber_Add, (PyObject* one, PyObject* other), (one, other))
STOPPING(double, PyFloat_AsDouble, (PyObject* one), (one))
STOPPING(long, PyLong_AsLong, (PyObject* one), (one))
STOPPING(unsigned long, PyLong_AsUnsignedLong, (PyObject* one), (one))
STOPPING(int, PyDict_Update, (PyObject* one, PyObject* other), (one, other))
STOPPING(int, PyErr_CheckSignals, (), ())
STOPPING(void, PyErr_NormalizeException, (PyObject** type, PyObject** value, PyObject** trace), (type, value, trace))
STOPPING(void, _Py_Dealloc, (PyObject* one), (one))
// clang-format on

#endif
