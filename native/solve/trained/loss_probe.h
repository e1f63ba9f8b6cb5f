// SPDX-License-Identifier: GPL-3.0-or-later
// Objectives for tests and benchmarks.
#pragma once

#include <memory>

#include "core/random.h"
#include "energies/external_energy.h"
#include "energies/handles.h"
#include "fields/radial_field.h"
#include "mesh/surface_samples.h"
#include "options/surface.h"

namespace arapfields {

struct LossGradient {
  double loss = 0.0;
  Vector gradient;
};

/// Value and parameter gradient of an objective in double precision, for comparison with finite differences:
/// a small network with the terms that a test needs. Handles are in cube coordinates, and exact if `margin`
/// is above 0.
class ARAPFIELDS_EXPORT_TO_TESTS LossProbe {
 public:
  LossProbe(const SurfaceSamples& samples, const std::vector<Handle>& handles, int width, double bending,
            const Points& preferred, double gauss, double barrier, double margin, double keep_stance,
            const ExternalEnergies& external = {}, const std::string& device = "cpu");
  ~LossProbe();
  /// Evaluates at these parameters, on the random subsets of the seed.
  LossGradient operator()(const Vector& parameters, std::uint64_t seed);
  /// Number of parameters.
  Index size() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The rigidity energy and its parameter gradient in a network of the default shape, for timing.
class ARAPFIELDS_EXPORT_TO_TESTS EnergyTrial {
 public:
  /// `batch` samples an evaluation; the network starts with random weights in its last layer as well.
  EnergyTrial(const SurfaceSamples& samples, Index batch, double bending);
  ~EnergyTrial();
  double run();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Local thickness at the samples, in mesh units; λ there, in the samples' cube.
ARAPFIELDS_EXPORT_TO_TESTS Vector probe_thickness(const SurfaceSamples& samples);
ARAPFIELDS_EXPORT_TO_TESTS Vector probe_bending(const SurfaceSamples& samples, const SurfaceOptions& options);

/// Jets of a field's own basis functions at points (n,3) of the cube: (columns·n, size), column by column.
ARAPFIELDS_EXPORT_TO_TESTS RowMatrix<double> probe_radial_rows(const RadialField& field, PointsIn points,
                                                               JetOrder order);

}  // namespace arapfields
