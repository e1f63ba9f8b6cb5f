// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <set>
#include <unordered_map>
#include <vector>

#include "extraction/sparse_grid.h"

namespace arapfields {

using Place = std::array<int, 3>;

/// Φ on the points of a grid `factor` times as fine as another one, in chosen cells of that one. Places are
/// of the fine grid; where they are multiples of `factor` they are points of the coarse grid.
class FineGrid {
 public:
  FineGrid(const SparseGrid& coarse, int factor) : coarse_(coarse), factor_(factor) {}

  int factor() const { return factor_; }
  const SparseGrid& coarse() const { return coarse_; }
  /// Cells of the coarse grid that are cut up, by their first points' coarse places.
  const std::set<Place>& cells() const { return cells_; }
  bool cut(const Place& cell) const { return cells_.contains(cell); }
  /// Cuts up further cells. Afterwards the sign is right at all points in them, as far as `slope` bounds
  /// |∇Φ|, and Φ known at both ends of every fine edge on which it changes.
  void cut(const std::set<Place>& cells, double slope, EvaluationCounter& function);

  float value(const Place& place) const;
  Vec3 position(const Place& place) const;

 private:
  struct Sample {
    float value = 0.0f;
    bool exact = false, known = false;  // whether value is Φ's own; whether its sign is right
  };
  static std::uint64_t key(const Place& place);
  void evaluate(const std::vector<Place>& places, EvaluationCounter& function);
  bool settle(const Place& place, Sample& sample, double slope) const;
  std::vector<Place> points_in(const std::set<Place>& cells) const;

  const SparseGrid& coarse_;
  int factor_;
  std::set<Place> cells_;
  std::unordered_map<std::uint64_t, Sample> samples_;
};

}  // namespace arapfields
