// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>

#include "core/types.h"
#include "energies/arap.h"
#include "energies/distortion.h"

namespace arapfields {

/// Options of a live solve. Lengths and weights refer to the unit cube of the samples' frame.
struct LiveOptions {
  int samples = 2000;                 ///< surface samples that the energy sees
  int coarse_centers = 60;            ///< centers of the coarse scale (0: none)
  int fine_centers = 300;             ///< centers of the fine scale
  double coarse_radius_factor = 3.0;  ///< radius of the coarse centers as a multiple of their spacing
  double fine_radius_factor = 4.0;    ///< the same of the fine centers
  bool interior = true;        ///< centers reach along the shape's interior (fields/interior_embedding.h)
  double bending = 0.01;       ///< λ_bend
  double handle_weight = 100;  ///< factor of the handles' mean squared distance
  int handle_samples = 300;    ///< samples that a handle pulls at, at most
  int steps = 12;              ///< quasi-Newton steps of one solve, at most
  double tolerance = 1e-4;     ///< a solve ends where a step is expected to gain less than this share
  double gauss_weight = 6.0;   ///< λ_Gauss of a style at strength 1
  double barrier = 0.0;        ///< weight of the barrier against folds
  double barrier_threshold = 0.1;
  int threads = 0;  ///< 0: all for the set-up, and for a solve where that is large
  std::int64_t seed = 0;
  void validate() const;  ///< throws InvalidInput that names the option
};

/// What a solve reached, measured at its own samples; energies in the unit cube, lengths in mesh units.
struct LiveReport {
  ArapValue arap;
  double energy = 0.0;  ///< stretch + bending · bend
  double value = 0.0;   ///< all that is minimised
  double handle_mean = 0.0, handle_max = 0.0;
  std::optional<double> preference;  ///< mean g of the deformed normals, where there is a style
  Distortion distortion;
  Index steps = 0, evaluations = 0;
  bool converged = false;
  double setup_seconds = 0.0, seconds = 0.0;
};

}  // namespace arapfields
