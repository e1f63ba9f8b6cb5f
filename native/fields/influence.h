// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "fields/interior_embedding.h"

namespace arapfields {

/// The influence m(x) of handles with a reach, a C³ weight: 1 near their places, 0 beyond the reach of all of
/// them. Distances are interior distances if there is an embedding, else Euclidean. f is replaced by x + m(x)
/// (f(x) − x).
class Influence {
 public:
  /// Places (k,3) with their reaches (k, positive), in the cube. Throws InvalidInput for other numbers.
  Influence(Points places, Vector reaches, std::shared_ptr<const InteriorEmbedding> embedding);

  /// m at points (n,3).
  Vector at(PointsIn points) const;
  /// Replaces the jets of f at points (n,3) by those of x + m (f − x); exactly those of x where m is 0.
  void confine(PointsIn points, JetView<double> jets) const;

  const Points& places() const { return places_; }
  const Vector& reaches() const { return reaches_; }
  const Points& embedded() const { return embedded_; }
  const std::shared_ptr<const InteriorEmbedding>& embedding() const { return embedding_; }

 private:
  template <class Consume>
  void for_each_point(PointsIn points, JetOrder order, Consume&& consume) const;

  Points places_;
  Vector reaches_;
  std::shared_ptr<const InteriorEmbedding> embedding_;
  Points embedded_;  // (k,3) ψ of the places; empty without an embedding
};

}  // namespace arapfields
