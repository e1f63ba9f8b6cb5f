// SPDX-License-Identifier: GPL-3.0-or-later
// Implicit functions and energies that are written in Python.
#pragma once

#include <mutex>

#include "bindings/bind.h"
#include "core/frame.h"
#include "core/implicit.h"
#include "energies/external_energy.h"

namespace arapfields::python {

/// The native half of a Python subclass of ImplicitFunction, whose __call__ takes points (n,3) of mesh
/// coordinates to distances (n), and whose gradient(), where it has one, takes them to derivatives (n,3).
/// One thread at a time is let in.
class PythonFunction final : public ImplicitFunction {
 public:
  explicit PythonFunction(const Frame& frame) : frame_(frame) {}
  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values) const override;
  void evaluate(ConstPointsRef<float> points, Eigen::Ref<VectorF> values,
                Eigen::Ref<PointsF> gradients) const override;
  std::optional<double> gradient_bound() const override;
  bool continuous() const override;
  Frame frame() const override { return frame_; }

 private:
  Frame frame_;
  mutable std::recursive_mutex one_at_a_time_;
};

/// The function that a Python object is; with it, C++ keeps the whole object. InvalidInput where it is none.
std::shared_ptr<const ImplicitFunction> as_function(const py::object& given, const std::string& argument);

/// Python's energies as those of a solve over samples with this frame. Each is any callable of
/// arapfields.Jets; InvalidInput names what is not, and what returns something else than an EnergyValue.
ExternalEnergies as_energies(const py::object& energies, const Frame& frame);

}  // namespace arapfields::python
