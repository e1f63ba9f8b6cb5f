// SPDX-License-Identifier: GPL-3.0-or-later
// Implicit functions and energies that are written in Python.
#pragma once

#include <mutex>

#include "bindings/bind.h"
#include "core/frame.h"
#include "core/implicit.h"
#include "energies/external_energy.h"

namespace arapfields::python {

/// The native half of a Python subclass of ImplicitFunction. Its __call__ maps points (n,3) of mesh
/// coordinates to distances (n), its gradient() to gradients (n,3). Thread-safe: one thread enters at a time.
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
  /// call(the Python object), with the GIL, from one thread at a time.
  template <class Call>
  auto locked(Call&& call) const;

  Frame frame_;
  mutable std::recursive_mutex mutex_;
};

/// The ImplicitFunction that a Python object is, keeping the object alive. InvalidInput for other objects.
std::shared_ptr<const ImplicitFunction> as_function(const py::object& object, const std::string& argument);

/// Python callables of arapfields.Jets as energies of a solve over samples with this frame. InvalidInput
/// names an item that is not callable, or that returns anything but an EnergyValue.
ExternalEnergies as_energies(const py::object& energies, const Frame& frame);

}  // namespace arapfields::python
