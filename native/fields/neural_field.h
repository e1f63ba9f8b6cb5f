// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>

#include "fields/field.h"
#include "fields/handle_blend.h"
#include "neural/mlp.h"

namespace arapfields {

class Tensor;

/// f(x) = b(x) + a(x) Ψ(x) with a trained network Ψ whose last layer starts at zero. Alone, b is the identity
/// and a is 1. Two fixed parts may be put in before training: a base field r, which training then refines,
/// and exact handles (fields/handle_blend.h), h with its free weight a; b = h + a (r − identity).
class NeuralField final : public TrainableField {
 public:
  /// `shape.outputs` must be 3. See Mlp for the rest.
  NeuralField(const MlpShape& shape, std::uint64_t seed, bool double_precision = false,
              const std::string& device = "cpu");
  ~NeuralField() override;

  /// Null for the identity; a base lives in the same cube.
  void set_base(std::shared_ptr<const DeformationField> base) { base_ = std::move(base); }
  /// Null for none.
  void set_handles(std::shared_ptr<const HandleBlend> handles) { handles_ = std::move(handles); }
  const std::shared_ptr<const DeformationField>& base() const { return base_; }
  const std::shared_ptr<const HandleBlend>& handles() const { return handles_; }
  const MlpShape& shape() const;

  void evaluate(PointsIn points, JetView<double> out) const override;
  Tensor jets(const Tensor& points, JetOrder order) const override;
  Tensor forward(const Tensor& points, JetOrder order) override;
  Tensor forward_at(PointsIn points, JetOrder order) override;
  void pull_back(const Tensor& cotangents) override;
  Tensor& parameters() override { return network_.parameters(); }
  Tensor& gradient() override { return network_.gradient(); }
  std::vector<MatrixPlace> matrices() const override;
  Mlp* network() { return &network_; }

  /// Adds an offset to Ψ, by the output layer's bias.
  void translate(const Vec3& offset) override;
  /// Weights and biases in the order of Mlp::parameters(), for files.
  VectorF weights() const;
  /// Throws InvalidInput where the count does not fit the shape.
  void set_weights(const VectorF& weights);

 private:
  /// The jets (columns, n, 3) of b as (columns·n, 3) rows, and those of a (columns, n), empty where a is 1.
  void fixed_part(PointsIn points, JetView<double> b, Vector& a) const;
  /// b + a Ψ from the jets of Ψ.
  Tensor compose(Tensor jets, PointsIn points);

  Mlp network_;
  std::shared_ptr<const DeformationField> base_;
  std::shared_ptr<const HandleBlend> handles_;
  std::shared_ptr<Tensor> factor_;  ///< a of the last forward call, (columns, n, 1); null where a is 1
};

}  // namespace arapfields
