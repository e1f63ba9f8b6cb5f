// SPDX-License-Identifier: GPL-3.0-or-later
// Jets as NumPy arrays (columns, n, 3), for the tests of energies and fields.
#pragma once

#include "bindings/bind.h"
#include "core/jets.h"

namespace arapfields::python {

template <class Scalar>
using JetArray = py::array_t<Scalar, py::array::c_style>;

/// Views an array of 1, 4 or 10 columns.
template <class Scalar>
JetView<Scalar> jet_view(JetArray<std::remove_const_t<Scalar>>& array) {
  require(array.ndim() == 3 && array.shape(2) == 3 &&
              (array.shape(0) == 1 || array.shape(0) == 4 || array.shape(0) == 10),
          "jets", std::to_string(array.ndim()) + " dimensions", "expected shape (1, 4 or 10; n; 3)");
  Scalar* data;
  if constexpr (std::is_const_v<Scalar>)
    data = array.data();
  else
    data = array.mutable_data();
  return {data, array.shape(1), static_cast<JetOrder>(array.shape(0))};
}

template <class Scalar>
JetArray<Scalar> zeros_like(const JetArray<Scalar>& array) {
  JetArray<Scalar> result(std::vector<py::ssize_t>(array.shape(), array.shape() + array.ndim()));
  std::fill_n(result.mutable_data(), result.size(), Scalar(0));
  return result;
}

/// `_native.testing`: what only tests call.
inline py::module_ testing_module(py::module_& module) {
  return module.def_submodule("testing", "Internals that tests compare with oracles; no public interface.");
}

}  // namespace arapfields::python
