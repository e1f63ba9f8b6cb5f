// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/options.h"

#include <ATen/Context.h>

#include <cmath>
#include <cstdio>

#include "core/errors.h"

namespace arapfields {
namespace {

std::string text(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%g", value);
  return buffer;
}

void in_range(const char* name, double value, double low, double high) {
  require(std::isfinite(value) && value >= low && value <= high, name, text(value),
          text(low) + " to " + text(high) + " is allowed");
}

void positive(const char* name, double value) {
  require(std::isfinite(value) && value > 0.0, name, text(value), "must be positive");
}

void not_negative(const char* name, double value) {
  require(std::isfinite(value) && value >= 0.0, name, text(value), "must not be negative");
}

template <class Options>
void validate_common(const Options& o) {
  require(o.field == "neural" || o.field == "radial", "field", "'" + o.field + "'",
          "'neural' or 'radial' is allowed");
  in_range("iterations", o.iterations, 0, 1e7);
  in_range("batch", o.batch, 1, 1e6);
  in_range("handle_batch", o.handle_batch, 1, 1e6);
  not_negative("bending", o.bending);
  not_negative("handle_weight", o.handle_weight);
  not_negative("barrier", o.barrier);
  positive("barrier_threshold", o.barrier_threshold);
  not_negative("learning_rate", o.learning_rate);
  require(o.optimizer == "orthogonal" || o.optimizer == "adam", "optimizer", "'" + o.optimizer + "'",
          "'orthogonal' or 'adam' is allowed");
  require(o.precision == "float32" || o.precision == "bfloat16", "precision", "'" + o.precision + "'",
          "'float32' or 'bfloat16' is allowed");
  not_negative("time_budget", o.time_budget);
  in_range("threads", o.threads, 0, 1024);
  resolve_device(o.device);
}

}  // namespace

void DeformOptions::validate() const {
  in_range("fresh_samples", fresh_samples, 0, 1e6);
  require(start == "identity" || start == "radial", "start", "'" + start + "'",
          "'identity' or 'radial' is allowed");
  validate_common(*this);
  in_range("bumps", bumps, 5, 3000);
  positive("margin", margin);
  const bool radial = field == "radial";
  require(!(radial && exact_handles), "exact_handles", "True with field='radial'",
          "they need field='neural'");
  require(!(radial && barrier > 0.0), "barrier", text(barrier) + " with field='radial'",
          "it needs field='neural'");
  require(!(radial && invertibility > 0.0), "invertibility", text(invertibility) + " with field='radial'",
          "it needs field='neural'");
  not_negative("invertibility", invertibility);
}

void StylizeOptions::validate() const {
  validate_common(*this);
  in_range("strength", strength, 0, 1);
  not_negative("gauss_weight", gauss_weight);
  positive("rigidity", rigidity);
  in_range("sharpness", sharpness, 0.1, 100);
}

std::string device_report() {
  if (at::hasCUDA()) return "a CUDA device was found";
  return at::detail::getCUDAHooks().hasCUDART()
             ? "no CUDA device: libtorch has CUDA, but neither a device nor its driver answers"
             : "no CUDA device: the libtorch here is the processor's build";
}

std::string resolve_device(const std::string& device) {
  const bool cuda = at::hasCUDA();
  if (device == "auto") return cuda ? "cuda" : "cpu";
  require(device == "cpu" || device.rfind("cuda", 0) == 0, "device", "'" + device + "'",
          "'auto', 'cpu' or 'cuda' is allowed");
  require(device == "cpu" || cuda, "device", "'" + device + "'", device_report());
  return device;
}

}  // namespace arapfields
