// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "neural/mlp.h"

namespace arapfields {

/// Options of deform. Lengths and weights refer to the unit cube of the samples' frame.
struct DeformOptions {
  std::string field = "neural";    ///< "neural" or "radial"
  std::string start = "identity";  ///< neural: what the network refines, "identity" or "radial"
  int centers = 300;  ///< fine centers of a radial field, to which a fifth of coarse ones is added
  int iterations = 300;
  int batch = 300;             ///< surface samples an iteration
  int fresh_samples = 0;       ///< of these, newly drawn from the surface at each iteration
  double bending = 0.01;       ///< λ_bend
  double handle_weight = 100;  ///< factor of the handles' mean squared distance
  int handle_batch = 256;      ///< samples a handle an iteration
  bool exact_handles = false;  ///< interpolate the handles' motions by construction
  double margin = 0.1;         ///< width of the exact handles' fall-off
  double barrier = 0.0;        ///< weight of the barrier against folds
  double barrier_threshold = 0.1;
  double invertibility = 0.0;      ///< weight of the cycle loss with an inverse that is trained along
  std::string optimizer = "muon";  ///< or "adam"
  double learning_rate = 0.0;      ///< at its peak; 0: 0.03 for muon, 0.002 for adam
  int width = 256, layers = 4, octaves = 4;
  double frequency = 1.0, sharpness = 30.0;
  std::string precision = "float32";  ///< or "bfloat16": see Mlp::round_products
  double time_budget = 0.0;           ///< seconds; 0: none
  int threads = 0;                    ///< 0: all
  std::string device = "auto";
  std::int64_t seed = 0;

  /// Throws InvalidInput that names the option.
  void validate() const;
};

/// Options of stylize.
struct StylizeOptions {
  std::string field = "neural";  ///< "neural" or "radial"
  double strength = 1.0;         ///< 0 (the shape itself) … 1
  double gauss_weight = 6.0;     ///< λ_Gauss at full strength
  double rigidity = 1.0;         ///< λ_ARAP
  double bending = 1e-3;         ///< λ_bend
  double sharpness = 5.0;        ///< σ: how narrow the preference is about each normal
  int iterations = 300;
  int batch = 500;
  double handle_weight = 100;
  int handle_batch = 256;
  double barrier = 10.0;
  double barrier_threshold = 0.2;
  std::string optimizer = "muon";  ///< or "adam"
  double learning_rate = 0.0;      ///< at its peak; 0: 0.03 for muon, 0.002 for adam
  int width = 256, layers = 4, octaves = 4;
  double frequency = 1.0, softplus_sharpness = 30.0;
  std::string precision = "float32";  ///< or "bfloat16", as in DeformOptions
  double time_budget = 0.0;
  int threads = 0;
  std::string device = "auto";
  std::int64_t seed = 0;

  void validate() const;
};

}  // namespace arapfields
