// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "core/jets.h"
#include "neural/mlp_shape.h"

namespace arapfields {

class Tensor;

/// The network with explicit jets. Values and first input derivatives travel through the layers as columns
/// (core/jets.h), one matrix product a layer for all of them. Second derivatives need no columns of their
/// own: they are sums over the layers of the outputs' derivatives by each unit, which one sweep downwards
/// finds, times what the units' softplus bends: seven columns instead of ten for three outputs. Cotangents
/// take the same ways back. Tensors are (columns, n, outputs), points (n,3); all have the network's dtype and
/// device. Work is split over threads by points; same seed, same thread count: same result, bit for bit.
class Mlp {
 public:
  /// Weights and biases uniform in ±1/√fan-in; the output layer zero with `zero_last_layer`.
  /// `device` is "cpu" or "cuda" (or "cuda:1", …). Throws InvalidInput for a shape out of range.
  Mlp(const MlpShape& shape, std::uint64_t seed, bool zero_last_layer, bool double_precision = false,
      const std::string& device = "cpu");
  ~Mlp();
  Mlp(Mlp&&) noexcept;
  Mlp& operator=(Mlp&&) noexcept;

  const MlpShape& shape() const;

  /// Jets at the points; keeps what pull_back needs until the next call. The result is a buffer of the
  /// network's: the next forward call overwrites it.
  Tensor forward(const Tensor& points, JetOrder order);
  /// Adds Σ ⟨cotangents, ∂jets/∂parameters⟩ of the last forward call to gradient(). Once for each forward
  /// call: it consumes the kept activations.
  void pull_back(const Tensor& cotangents);

  /// Whether forward() and pull_back() round the factors and the results of the hidden layers' products to
  /// bfloat16, which processors with such instructions (AVX512-BF16, AMX) multiply twice as fast. Everything
  /// else stays in single precision: sums within a product, parameters, gradient, whatever evaluate()
  /// computes. Of no effect in double precision.
  void round_products(bool rounded);

  /// Frees what forward() keeps; the next call allocates again.
  void release_buffers();

  /// Jets at the points, nothing kept, in chunks: memory beyond the result does not grow with n.
  Tensor evaluate(const Tensor& points, JetOrder order) const;
  /// For networks with one output: values (n) and input gradients (n,3) by one backward sweep a chunk.
  void evaluate_with_gradient(const Tensor& points, Tensor& values, Tensor& gradients) const;

  /// All weights and biases, and their gradient, as one contiguous vector (p): weight 0, bias 0, weight 1, …
  Tensor& parameters();
  const Tensor& parameters() const;
  Tensor& gradient();
  /// Views (fan_out, fan_in) and (fan_out) into parameters(); `layer` runs from 0 to shape().layers, the
  /// output's.
  Tensor weight(int layer) const;
  Tensor bias(int layer) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace arapfields
