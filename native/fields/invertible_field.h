// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>

#include "core/jets.h"
#include "fields/field.h"
#include "neural/coupling_shape.h"

namespace arapfields {

class Tensor;

/// f as coupling layers that alternate over the axes (neural/coupling_shape.h): det J > 0 everywhere, and f⁻¹
/// in closed form, by construction. The identity before training. Computed on the CPU; coordinates are in
/// double precision in both directions, so that preimages() of evaluate() is accurate to about 1e-6.
class InvertibleField final : public TrainableField {
 public:
  /// Throws InvalidInput for a shape out of range.
  InvertibleField(const CouplingShape& shape, std::uint64_t seed, bool double_precision = false);
  ~InvertibleField() override;

  const CouplingShape& shape() const;
  void evaluate(PointsIn points, JetView<double> out) const override;
  bool has_preimages() const override { return true; }
  Points preimages(PointsIn points) const override;
  Tensor forward(const Tensor& points, JetOrder order) override;
  Tensor forward_at(PointsIn points, JetOrder order) override;
  void pull_back(const Tensor& cotangents) override;
  Tensor& parameters() override;
  Tensor& gradient() override;
  std::vector<MatrixPlace> matrices() const override;
  void translate(const Vec3& offset) override;

  /// All parameters, for files. set_weights() throws InvalidInput where the count does not fit the shape.
  VectorF weights() const;
  void set_weights(const VectorF& weights);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// An invertible field with given numbers, in double precision on plain arrays: for comparison.

/// Jets (columns, n, 3) at points (n,3), row by row; for given cotangents (the same size, or none) the flat
/// parameter gradient; and preimages() of the jets' values.
struct InvertibleProbe {
  Vector jets, gradient;
  Points preimages;
};
ARAPFIELDS_EXPORT_TO_TESTS InvertibleProbe probe_invertible(const CouplingShape& shape,
                                                            const Vector& parameters, PointsIn points,
                                                            JetOrder order, const Vector& cotangents);

}  // namespace arapfields
