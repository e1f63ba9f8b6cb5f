// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/options.h"

#include "core/device.h"
#include "core/errors.h"

namespace arapfields {
namespace {

template <class Options>
void validate_common(const Options& o) {
  require(o.field == "neural" || o.field == "radial", "field", "'" + o.field + "'",
          "'neural' or 'radial' is allowed");
  require_range("iterations", o.iterations, 0, 1e7);
  require_range("batch", o.batch, 1, 1e6);
  require_range("handle_batch", o.handle_batch, 1, 1e6);
  require_not_negative("bending", o.bending);
  require_not_negative("handle_weight", o.handle_weight);
  require_not_negative("barrier", o.barrier);
  require_positive("barrier_threshold", o.barrier_threshold);
  require_not_negative("learning_rate", o.learning_rate);
  require(o.optimizer == "muon" || o.optimizer == "adam", "optimizer", "'" + o.optimizer + "'",
          "'muon' or 'adam' is allowed");
  require(o.precision == "float32" || o.precision == "bfloat16", "precision", "'" + o.precision + "'",
          "'float32' or 'bfloat16' is allowed");
  require_not_negative("time_budget", o.time_budget);
  require_range("threads", o.threads, 0, 1024);
  resolve_device(o.device);
}

}  // namespace

void DeformOptions::validate() const {
  require_range("fresh_samples", fresh_samples, 0, 1e6);
  require(start == "identity" || start == "radial", "start", "'" + start + "'",
          "'identity' or 'radial' is allowed");
  validate_common(*this);
  require_range("centers", centers, 5, 3000);
  require_positive("margin", margin);
  const bool radial = field == "radial";
  require(!(radial && exact_handles), "exact_handles", "True with field='radial'",
          "they need field='neural'");
  require(!(radial && barrier > 0.0), "barrier", number_text(barrier) + " with field='radial'",
          "it needs field='neural'");
  require(!(radial && invertibility > 0.0), "invertibility",
          number_text(invertibility) + " with field='radial'", "it needs field='neural'");
  require_not_negative("invertibility", invertibility);
}

void StylizeOptions::validate() const {
  validate_common(*this);
  require_range("strength", strength, 0, 1);
  require_not_negative("gauss_weight", gauss_weight);
  require_positive("rigidity", rigidity);
  require_range("sharpness", sharpness, 0.1, 100);
}

}  // namespace arapfields
