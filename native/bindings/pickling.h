// SPDX-License-Identifier: GPL-3.0-or-later
// The states of classes that are pickled by their numbers: tuples of parts.
#pragma once

#include <cmath>
#include <string>
#include <utility>

#include "bindings/arrays.h"

namespace arapfields::python {

/// The parts of a state. InvalidInput that names the class and the part where a damaged pickle holds
/// something else.
class PickledState {
 public:
  PickledState(const py::tuple& parts, std::string kind, std::size_t count)
      : parts_(parts), kind_(std::move(kind)) {
    require(parts_.size() == count, "pickled " + kind_, std::to_string(parts_.size()) + " parts",
            std::to_string(count) + " are needed");
  }
  std::string name(std::size_t i) const { return "pickled " + kind_ + "[" + std::to_string(i) + "]"; }
  py::object operator[](std::size_t i) const { return parts_[i]; }
  bool has(std::size_t i) const { return !(*this)[i].is_none(); }

  double number(std::size_t i) const {
    const py::array_t<double> read = as_doubles((*this)[i], name(i));
    require(read.size() == 1, name(i), std::to_string(read.size()) + " numbers", "one is needed");
    return *read.data();
  }
  Index index(std::size_t i) const {
    const double read = number(i);
    require(read >= 0.0 && read <= 1e15 && read == std::floor(read), name(i), number_text(read),
            "an index is needed");
    return static_cast<Index>(read);
  }
  Vector vector(std::size_t i) const { return as_vector((*this)[i], name(i)); }
  Points points(std::size_t i) const { return as_finite_points((*this)[i], name(i)); }
  /// Finite numbers of shape (rows, columns); rows < 0: any number of them.
  Eigen::MatrixXd matrix(std::size_t i, Index rows, Index columns) const {
    const Eigen::MatrixXd read = as_matrix((*this)[i], name(i));
    require((rows < 0 || read.rows() == rows) && read.cols() == columns && read.allFinite(), name(i),
            "another shape, or numbers that are not finite",
            "(" + (rows < 0 ? "n" : std::to_string(rows)) + ", " + std::to_string(columns) + ") is needed");
    return read;
  }
  template <class Bound>
  const Bound& of(std::size_t i, const std::string& needed) const {
    require(py::isinstance<Bound>((*this)[i]), name(i), "got " + type_text((*this)[i]),
            "a " + needed + " is needed");
    return (*this)[i].template cast<const Bound&>();
  }

 private:
  py::tuple parts_;
  std::string kind_;
};

}  // namespace arapfields::python
