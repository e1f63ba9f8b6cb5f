// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "energies/handles.h"
#include "mesh/surface_samples.h"
#include "options/surface.h"
#include "sampling/local_thickness.h"

namespace arapfields {

/// λ of the energy mean w (‖J − R‖² + λ·bend) at each point of a rest surface: (0.345 t)² times the options'
/// factor, t the local thickness, or the same number everywhere. In the samples' cube.
class SurfaceStiffness {
 public:
  SurfaceStiffness() = default;
  explicit SurfaceStiffness(double bending) : bending_(bending) {}
  SurfaceStiffness(std::shared_ptr<const LocalThickness> thickness, const SurfaceOptions& options);
  SurfaceStiffness(const SurfaceSamples& samples, const SurfaceOptions& options);

  /// Whether any point resists bending.
  bool bends() const { return bending_ > 0.0; }
  /// λ at points (n,3) of the surface.
  Vector bending(PointsIn points) const;

 private:
  double bending_ = 0.0;  // λ, or with a thickness the factor on its square
  std::shared_ptr<const LocalThickness> thickness_;
};

/// w of each sample (empty: all 1): the samples' own weights, but nearly 0 in a handle that may scale, since
/// the energy resists scaling.
Vector energy_weights(const SurfaceSamples& samples, const BoundHandles& handles);

/// The samples' λ times their own bend weights.
Vector bending_at(const SurfaceSamples& samples, const SurfaceStiffness& stiffness);

}  // namespace arapfields
