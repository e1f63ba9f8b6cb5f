// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/jets.h"
#include "fields/radial_basis.h"
#include "fields/radial_kernel.h"

namespace arapfields {

/// Evaluates fields of one basis at fixed points, many times. Efficient where consecutive points are close
/// (morton_order): each block keeps the list of centers whose support meets it. Float has half double's
/// cost and errors of some 1e-6 of the jets.
template <class Scalar>
class RadialEvaluator {
 public:
  static constexpr Index block_size = 16;  ///< points

  RadialEvaluator() = default;
  /// `most`: the highest order that will be evaluated. `embedded`: the basis' embedding of the points, if it
  /// is known and `most` is the value. `sides`: those of the points, as in InteriorEmbedding::evaluate().
  RadialEvaluator(const RadialBasis& basis, PointsIn points, JetOrder most = JetOrder::second,
                  const Points* embedded = nullptr, const std::vector<SurfaceSide>* sides = nullptr);
  Index size() const { return count_; }

  /// Jets of the field with these coefficients (size, 3), written to `out` (count = size(), any order), for
  /// all blocks or `of_blocks` alone.
  void evaluate(const RowMatrix<double>& coefficients, JetView<Scalar> out,
                const std::vector<Index>* of_blocks = nullptr) const;
  /// Adds the pull-back of cotangents of such jets to `gradient` (size, 3).
  void pull_back(JetView<const Scalar> cotangents, RowMatrix<double>& gradient) const;

  /// Calls body(b, block) for the blocks of 16 points, in parallel.
  template <class Body>
  void for_blocks(Body&& body) const;
  Index center_count() const { return center_count_; }
  Index blocks() const { return (count_ + block_size - 1) / block_size; }
  /// Points 16 b to 16 b + 15, the last of all repeated.
  RadialBlock<Scalar> block(Index b) const;

 private:
  void pack_embedding(const JetBlock<double>& jets);
  void require_order(JetOrder order) const;

  Index center_count_ = 0;
  Index count_ = 0;
  std::vector<Scalar> points_;     // (blocks, 3, 16), the last point repeated
  std::vector<Scalar> centers_;    // (m, center_stride)
  std::vector<Scalar> embedding_;  // (blocks, embedding_rows_, 16); empty without an embedding
  JetOrder most_ = JetOrder::second;
  std::vector<std::int32_t>
      active_;  // centers that affect block b: active_[start_[b]] … active_[start_[b+1]−1]
  std::vector<Index> start_;
};

/// Basis functions' own jets at the points: (columns·n, size), column by column. `embedded` as above.
RowMatrix<double> radial_rows(const RadialBasis& basis, PointsIn points, JetOrder order,
                              const Points* embedded = nullptr);

}  // namespace arapfields
