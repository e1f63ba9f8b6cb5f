// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <set>
#include <unordered_map>
#include <utility>
#include <vector>

#include "sampling/tricubic_surrogate.h"

namespace arapfields {

/// Φ on a grid of resolution³ points over [-1,1]³, kept in blocks of 8³ points near the surface only. Away
/// from it, and wherever the model is sure, only Φ's sign is known. After refine() the sign is right
/// everywhere, as far as the model's bounds hold, and both ends of every edge on which it changes have Φ's
/// own value.
class SparseGrid {
 public:
  static constexpr int side = 8, points = side * side * side;
  static constexpr float far = 1e30f;  ///< the value where only the sign is known
  static constexpr int window_side = side + 2, window_points = window_side * window_side * window_side;

  struct Block {
    int place[3];                ///< in blocks
    float value[points];         ///< Φ, the model's p, or ±far
    float error[points];         ///< Φ's sign is ambiguous where |value| is not above this
    std::uint8_t exact[points];  ///< whether value is Φ's own
  };
  /// A block with one layer of points around it; NaN outside the grid.
  struct Window {
    float value[window_points], error[window_points];
    std::uint8_t exact[window_points];
    bool kept[window_points];  ///< whether the point's block is kept
    /// i, j, k from −1 to 8
    static int at(int i, int j, int k) { return ((i + 1) * window_side + j + 1) * window_side + k + 1; }
  };

  /// Without a model (nullptr) all blocks are kept and every point is evaluated; of a model that does not
  /// interpolate, every point in its active cells.
  SparseGrid(int resolution, const TricubicSurrogate* model);
  void refine(EvaluationCounter& function);

  int resolution() const { return resolution_; }
  /// Coordinate of the i-th grid point along an axis.
  double coordinate(int i) const { return i + 1 == resolution_ ? 1.0 : i * spacing_ - 1.0; }
  const std::vector<Block>& blocks() const { return blocks_; }
  /// Φ at a grid point as a block has it; ±1e30 outside of the blocks that are kept.
  float value(int i, int j, int k) const;
  bool exact(int i, int j, int k) const;
  /// Index into blocks(), or −1.
  Index find(int i, int j, int k) const;
  /// Point of a block in its arrays, from coordinates within it.
  static int local(int i, int j, int k) { return (i * side + j) * side + k; }
  void load(const Block& block, Window& window) const;

 private:
  struct Point {
    std::int32_t block, local;
  };
  /// What a round evaluates: first the ends of edges on which p changes its sign, then ambiguous points.
  enum class Round { changes, every_other, rest };
  struct Evaluations {
    std::vector<Point> points;                   // to evaluate
    std::vector<std::pair<Point, int>> settled;  // ambiguous points that need no evaluation, and their signs
    std::vector<Index> neighbours;               // blocks to keep from now on, as indices into table_
  };
  Index entry(int i, int j, int k) const { return (static_cast<Index>(i) * width_ + j) * width_ + k; }
  void keep(Index entry);
  void predict(Block& block) const;
  void keep_around(const Block& block, const Window& window, int i, int j, int k,
                   std::vector<Index>& missing) const;
  int settled_sign(const Window& window, int i, int j, int k, double slope, double slack) const;
  void collect_evaluations(std::int32_t block, Round round, Evaluations& out) const;

  int resolution_;
  int width_;  // blocks a side
  double spacing_;
  const TricubicSurrogate* model_;
  bool no_surrogate_;  // no p: every point whose side is not known is evaluated
  std::vector<std::int32_t>
      table_;  // width³: index into blocks_, −1 for the positive and −2 for the negative
  std::vector<Block> blocks_;
};

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
