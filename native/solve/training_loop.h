// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/errors.h"
#include "core/random.h"
#include "core/task.h"
#include "fields/field.h"
#include "options/training.h"

namespace arapfields {

/// A loss of a trainable field, estimated anew at each iteration on a random subset.
class Objective {
 public:
  virtual ~Objective() = default;
  /// Adds the gradient of the estimate to field.gradient(); returns the estimate, one number wherever it was
  /// computed.
  virtual at::Tensor accumulate(TrainableField& field, Random& random) = 0;
};

/// How to descend. "muon" is neural/muon.h, for fields that are networks; "adam" serves any.
/// Short memories (momentum, decays) suit the few hundred steps of a solve. The learning rate is held for
/// `lr_hold_fraction` of the run and then falls along a half cosine to final_share of itself, so that the
/// last steps average out the noise of the subsets; where a time budget is ahead of the iterations, it
/// follows the clock.
struct LoopOptions {
  std::string stage = "solving";  ///< what messages call the loop
  TrainingOptions training;
  double final_share = 0.05;
  double lr_hold_fraction = 0.5;
  double momentum = 0.8;    ///< of muon
  double adam_share = 0.3;  ///< of muon: the rate of biases and the output layer over the matrices'
  double beta1 = 0.8, beta2 = 0.9;
};

struct LoopResult {
  int iterations = 0;
  double seconds = 0.0;
  bool out_of_time = false;
  std::vector<std::pair<int, double>> history;  ///< (iteration, loss), at most a few hundred entries
};

/// Called with the number of finished iterations after each of them.
using LoopObserver = std::function<void(int)>;

/// Minimises. Losses that a device computes are read a few dozen at a time, so that the loop does not wait
/// for it. Where the loss or the gradient leaves the finite numbers, the parameters of the last good state
/// are put back and Diverged is thrown, which names the iteration of both.
LoopResult minimise(TrainableField& field, Objective& objective, const LoopOptions& options,
                    const Progress& progress, const LoopObserver& observer = {});

}  // namespace arapfields
