// SPDX-License-Identifier: GPL-3.0-or-later
#include "extraction/sparse_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/parallel.h"

namespace arapfields {
namespace {

constexpr float outside_grid = std::numeric_limits<float>::quiet_NaN();
constexpr Index blocks_per_chunk = 16;
// Φ is evaluated where |p| is below this share of the model's bound on |Φ − p|, which is three times the
// largest residual nearby. On eight published networks at twenty resolutions no vertex is missing even so.
constexpr float ambiguous_share = 0.8f;

constexpr int neighbours[6][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};

bool differs(float a, float b) { return (a < 0.0f) != (b < 0.0f) && !std::isnan(a) && !std::isnan(b); }

}  // namespace

SparseGrid::SparseGrid(int resolution, const TricubicSurrogate* model)
    : resolution_(resolution),
      width_((resolution + side - 1) / side),
      spacing_(2.0 / (resolution - 1)),
      model_(model),
      no_surrogate_(model == nullptr || !model->interpolates()),
      table_(static_cast<std::size_t>(width_) * width_ * width_, -1) {
  std::vector<std::uint8_t> marked(table_.size(), model == nullptr ? 1 : 0);
  if (model != nullptr) {
    for (const Index cell : model->active()) {
      const auto place = model->coordinates(cell);
      int low[3], high[3];  // the blocks within a grid step of the cell
      for (int axis = 0; axis < 3; ++axis) {
        const double from = place[axis] * model->spacing() / spacing_,
                     to = from + model->spacing() / spacing_;
        low[axis] = std::max(0, static_cast<int>(std::floor(from)) - 1) / side;
        high[axis] = std::min(resolution - 1, static_cast<int>(std::ceil(to)) + 1) / side;
      }
      for (int i = low[0]; i <= high[0]; ++i)
        for (int j = low[1]; j <= high[1]; ++j)
          for (int k = low[2]; k <= high[2]; ++k) marked[entry(i, j, k)] = 1;
    }
    for (int i = 0; i < width_; ++i)
      for (int j = 0; j < width_; ++j)
        for (int k = 0; k < width_; ++k) {
          const auto position = [&](int block) { return model->position(coordinate(block * side)); };
          if (model->side(model->cell(position(i), position(j), position(k))) < 0)
            table_[entry(i, j, k)] = -2;
        }
  }
  Index count = 0;
  for (const auto each : marked) count += each;
  blocks_.reserve(count);
  for (std::size_t i = 0; i < marked.size(); ++i)
    if (marked[i]) keep(static_cast<Index>(i));
}

Index SparseGrid::find(int i, int j, int k) const {
  if (i < 0 || j < 0 || k < 0 || i >= width_ || j >= width_ || k >= width_) return -1;
  return std::max(-1, table_[entry(i, j, k)]);
}

float SparseGrid::value(int i, int j, int k) const {
  const std::int32_t index = table_[entry(i / side, j / side, k / side)];
  if (index < 0) return index == -2 ? -far : far;
  return blocks_[index].value[local(i % side, j % side, k % side)];
}

bool SparseGrid::exact(int i, int j, int k) const {
  const Index index = find(i / side, j / side, k / side);
  return index >= 0 && blocks_[index].exact[local(i % side, j % side, k % side)] != 0;
}

void SparseGrid::keep(Index entry) {
  blocks_.emplace_back();
  Block& block = blocks_.back();
  block.place[0] = static_cast<int>(entry / (static_cast<Index>(width_) * width_));
  block.place[1] = static_cast<int>(entry / width_ % width_);
  block.place[2] = static_cast<int>(entry % width_);
  table_[entry] = static_cast<std::int32_t>(blocks_.size()) - 1;
  std::fill_n(block.exact, points, std::uint8_t{0});
  std::fill_n(block.error, points, no_surrogate_ ? 2.0f * far : 0.0f);
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      for (int k = 0; k < side; ++k) {
        const int last =
            std::max({block.place[0] * side + i, block.place[1] * side + j, block.place[2] * side + k});
        block.value[local(i, j, k)] = last < resolution_ ? far : outside_grid;
      }
  if (model_ != nullptr) predict(block);
}

/// Signs and values as the model has them, cell by cell.
void SparseGrid::predict(Block& block) const {
  int cells[3][side];
  float weights[3][side][4];
  int count[3];
  for (int axis = 0; axis < 3; ++axis) {
    count[axis] = std::min(side, resolution_ - block.place[axis] * side);
    for (int i = 0; i < count[axis]; ++i) {
      const double x = coordinate(block.place[axis] * side + i);
      cells[axis][i] = model_->position(x);
      const double u = (x + 1.0) / model_->spacing() - model_->block_start(cells[axis][i]);
      cubic_weights(static_cast<float>(u), weights[axis][i]);
    }
  }
  const auto run_end = [&](int axis, int begin) {
    int end = begin;
    while (end < count[axis] && cells[axis][end] == cells[axis][begin]) ++end;
    return end;
  };
  for (int i0 = 0, i1; i0 < count[0]; i0 = i1) {
    i1 = run_end(0, i0);
    for (int j0 = 0, j1; j0 < count[1]; j0 = j1) {
      j1 = run_end(1, j0);
      for (int k0 = 0, k1; k0 < count[2]; k0 = k1) {
        k1 = run_end(2, k0);
        const Index cell = model_->cell(cells[0][i0], cells[1][j0], cells[2][k0]);
        const int sign = model_->side(cell);
        CubicBlock nodes;
        if (sign == 0 && !no_surrogate_) nodes = model_->block(cell);
        for (int i = i0; i < i1; ++i) {
          float plane[16];
          for (int n = 0; n < 16 && sign == 0 && !no_surrogate_; ++n) {
            plane[n] = 0.0f;
            for (int a = 0; a < 4; ++a) plane[n] += weights[0][i][a] * nodes.node[16 * a + n];
          }
          for (int j = j0; j < j1; ++j)
            for (int k = k0; k < k1; ++k) {
              const int at = local(i, j, k);
              if (sign != 0) {
                block.value[at] = static_cast<float>(sign) * far;
                block.error[at] = 0.0f;
                continue;
              }
              if (no_surrogate_) continue;
              float value = 0.0f;
              for (int b = 0; b < 4; ++b)
                for (int c = 0; c < 4; ++c) value += weights[1][j][b] * weights[2][k][c] * plane[4 * b + c];
              block.value[at] = value;
              block.error[at] = ambiguous_share * model_->error(cell);
              if (std::abs(value) > block.error[at]) continue;
              const int kept = model_->settled_sign(
                  cell, {coordinate(block.place[0] * side + i), coordinate(block.place[1] * side + j),
                         coordinate(block.place[2] * side + k)});
              if (kept != 0 && (value < 0.0f) == (kept < 0)) block.error[at] = 0.0f;
            }
        }
      }
    }
  }
}

void SparseGrid::load(const Block& block, Window& window) const {
  int from[3], to[3];
  for (int di = -1; di <= 1; ++di)
    for (int dj = -1; dj <= 1; ++dj)
      for (int dk = -1; dk <= 1; ++dk) {
        const int step[3] = {di, dj, dk};
        bool inside = true;
        for (int axis = 0; axis < 3; ++axis) {
          from[axis] = step[axis] < 0 ? -1 : step[axis] == 0 ? 0 : side;
          to[axis] = step[axis] < 0 ? 0 : step[axis] == 0 ? side : side + 1;
          const int place = block.place[axis] + step[axis];
          inside = inside && place >= 0 && place < width_;
        }
        const int i0 = block.place[0] + di, j0 = block.place[1] + dj, k0 = block.place[2] + dk;
        const std::int32_t index = inside ? table_[entry(i0, j0, k0)] : -1;
        const Block* source = index >= 0 ? &blocks_[index] : nullptr;
        for (int i = from[0]; i < to[0]; ++i)
          for (int j = from[1]; j < to[1]; ++j)
            for (int k = from[2]; k < to[2]; ++k) {
              const int at = Window::at(i, j, k), source_at = local(i & 7, j & 7, k & 7);
              window.kept[at] = source != nullptr || !inside;
              window.exact[at] = source != nullptr ? source->exact[source_at] : 0;
              window.error[at] = source != nullptr ? source->error[source_at] : 0.0f;
              window.value[at] = source != nullptr ? source->value[source_at]
                                 : !inside         ? outside_grid
                                 : index == -2     ? -far
                                                   : far;
            }
      }
}

/// All cells around a point at a change of sign must be in blocks that are kept.
void SparseGrid::keep_around(const Block& block, const Window& window, int i, int j, int k,
                             std::vector<Index>& missing) const {
  const auto shift = [](int at) { return at < 0 ? -1 : at / side; };
  for (int x = i - 1; x <= i + 1; ++x)
    for (int y = j - 1; y <= j + 1; ++y)
      for (int z = k - 1; z <= k + 1; ++z)
        if (!window.kept[Window::at(x, y, z)])
          missing.push_back(
              entry(block.place[0] + shift(x), block.place[1] + shift(y), block.place[2] + shift(z)));
}

/// The sign that |Φ| at one of the 26 points beside a point leaves it, to be more than `slack` away from
/// zero.
int SparseGrid::settled_sign(const Window& window, int i, int j, int k, double slope, double slack) const {
  for (int n = 0; n < 27; ++n) {
    const int x = n / 9 - 1, y = n / 3 % 3 - 1, z = n % 3 - 1, next = Window::at(i + x, j + y, k + z);
    if (!window.exact[next]) continue;
    const double largest_change =
        slope * spacing_ * std::sqrt(static_cast<double>(x * x + y * y + z * z)) + slack;
    if (std::abs(window.value[next]) > largest_change) return window.value[next] < 0.0f ? -1 : 1;
  }
  return 0;
}

/// Points of a block to evaluate: ends of edges on which the sign changes, and points of ambiguous sign,
/// every other one of each axis first. The sign of a point is settled without an evaluation where |Φ| at a
/// neighbour exceeds what Φ can change by over their distance.
void SparseGrid::collect_evaluations(std::int32_t index, Round round, Evaluations& out) const {
  const Block& block = blocks_[index];
  Window window;
  load(block, window);
  const double slope = model_ == nullptr ? far : model_->lipschitz();
  // Thin parts are detected by points deeper than a step. Without p, nothing else bounds the depth of a
  // settled point.
  const double slack = no_surrogate_ ? spacing_ : 0.0;
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      for (int k = 0; k < side; ++k) {
        const int at = Window::at(i, j, k);
        const float value = window.value[at];
        if (std::isnan(value)) continue;
        if (!window.exact[at] && std::abs(value) <= window.error[at]) {
          const int sign = settled_sign(window, i, j, k, slope, slack);
          if (sign != 0 && (no_surrogate_ || (value < 0.0f) == (sign < 0))) {
            out.settled.push_back({{index, local(i, j, k)}, sign});
            continue;
          }
          const bool even = ((i | j | k) & 1) == 0;
          if (round == Round::rest || (round == Round::every_other && even) ||
              (no_surrogate_ && model_ == nullptr)) {
            out.points.push_back({index, local(i, j, k)});
            continue;
          }
          if (no_surrogate_) continue;
        }
        bool change = false;
        for (const auto& step : neighbours) {
          const int next = Window::at(i + step[0], j + step[1], k + step[2]);
          const bool unknown = no_surrogate_ && !window.exact[next] && window.error[next] > 0.0f;
          change = change || (!unknown && differs(value, window.value[next]));
        }
        if (change) keep_around(block, window, i, j, k, out.neighbours);
        if (change && !window.exact[at]) out.points.push_back({index, local(i, j, k)});
      }
}

void SparseGrid::refine(EvaluationCounter& function) {
  for (Round round = no_surrogate_ ? Round::every_other : Round::changes;;) {
    const auto count = static_cast<Index>(blocks_.size());
    const Index chunks = (count + blocks_per_chunk - 1) / blocks_per_chunk;
    std::vector<Evaluations> parts(chunks);
    parallel_for(0, chunks, 1, [&](Index begin, Index end) {
      for (Index chunk = begin; chunk < end; ++chunk)
        for (Index b = chunk * blocks_per_chunk; b < std::min(count, (chunk + 1) * blocks_per_chunk); ++b)
          collect_evaluations(static_cast<std::int32_t>(b), round, parts[chunk]);
    });
    std::vector<Point> to_evaluate;
    bool grown = false;
    for (const Evaluations& each : parts) {
      to_evaluate.insert(to_evaluate.end(), each.points.begin(), each.points.end());
      for (const auto& [point, sign] : each.settled) {
        Block& block = blocks_[point.block];
        if (no_surrogate_) block.value[point.local] = static_cast<float>(sign) * far;
        block.error[point.local] = 0.0f;
        grown = true;
      }
      for (const Index neighbour : each.neighbours)
        if (table_[neighbour] < 0) {
          keep(neighbour);
          grown = true;
        }
    }
    if (to_evaluate.empty() && !grown && round == Round::rest) return;
    round = round == Round::changes ? Round::every_other : Round::rest;
    PointsF places(static_cast<Index>(to_evaluate.size()), 3);
    for (std::size_t row = 0; row < to_evaluate.size(); ++row) {
      const Block& block = blocks_[to_evaluate[row].block];
      const int at = to_evaluate[row].local, within[3] = {at / (side * side), at / side % side, at % side};
      for (int axis = 0; axis < 3; ++axis)
        places(static_cast<Index>(row), axis) =
            static_cast<float>(coordinate(block.place[axis] * side + within[axis]));
    }
    const VectorF values = function.values(places);
    for (std::size_t row = 0; row < to_evaluate.size(); ++row) {
      Block& block = blocks_[to_evaluate[row].block];
      const int at = to_evaluate[row].local;
      block.error[at] = 0.0f;
      block.value[at] = values[row];
      block.exact[at] = 1;
    }
  }
}

namespace {

Place shifted(Place place, int axis, int by) {
  place[axis] += by;
  return place;
}

}  // namespace

std::uint64_t FineGrid::key(const Place& place) {
  return (static_cast<std::uint64_t>(place[0]) << 40) | (static_cast<std::uint64_t>(place[1]) << 20) |
         static_cast<std::uint64_t>(place[2]);
}

float FineGrid::value(const Place& place) const {
  const auto sample_at = samples_.find(key(place));
  if (sample_at != samples_.end()) return sample_at->second.value;
  return coarse_.value(place[0] / factor_, place[1] / factor_, place[2] / factor_);
}

Vec3 FineGrid::position(const Place& place) const {
  Vec3 result;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int cell = place[axis] / factor_, part = place[axis] % factor_;
    const double from = coarse_.coordinate(cell);
    result[axis] = part == 0 ? from : from + (coarse_.coordinate(cell + 1) - from) * part / factor_;
  }
  return result;
}

std::vector<Place> FineGrid::points_in(const std::set<Place>& cells) const {
  std::set<Place> points;
  for (const Place& cell : cells)
    for (int i = 0; i <= factor_; ++i)
      for (int j = 0; j <= factor_; ++j)
        for (int k = 0; k <= factor_; ++k)
          points.insert({cell[0] * factor_ + i, cell[1] * factor_ + j, cell[2] * factor_ + k});
  return {points.begin(), points.end()};
}

void FineGrid::evaluate(const std::vector<Place>& places, EvaluationCounter& function) {
  PointsF points(static_cast<Index>(places.size()), 3);
  for (std::size_t i = 0; i < places.size(); ++i)
    points.row(i) = position(places[i]).transpose().cast<float>();
  const VectorF values = function.values(points);
  for (std::size_t i = 0; i < places.size(); ++i) samples_[key(places[i])] = {values[i], true, true};
}

/// Takes over the sign of a neighbour whose |Φ| exceeds what Φ can change by over their distance.
bool FineGrid::settle(const Place& place, Sample& sample, double slope) const {
  const double step = (coarse_.coordinate(1) - coarse_.coordinate(0)) / factor_;
  for (int i = -2; i <= 2; ++i)
    for (int j = -2; j <= 2; ++j)
      for (int k = -2; k <= 2; ++k) {
        if (place[0] + i < 0 || place[1] + j < 0 || place[2] + k < 0) continue;
        const auto sample_at = samples_.find(key({place[0] + i, place[1] + j, place[2] + k}));
        if (sample_at == samples_.end() || !sample_at->second.exact) continue;
        const double largest_change = slope * step * std::sqrt(static_cast<double>(i * i + j * j + k * k));
        if (std::abs(sample_at->second.value) <= largest_change) continue;
        sample = {sample_at->second.value < 0.0f ? -SparseGrid::far : SparseGrid::far, false, true};
        return true;
      }
  return false;
}

void FineGrid::cut(const std::set<Place>& cells, double slope, EvaluationCounter& function) {
  std::set<Place> fresh;
  for (const Place& cell : cells)
    if (cells_.insert(cell).second) fresh.insert(cell);
  const std::vector<Place> points = points_in(fresh);
  std::vector<Place> to_evaluate;
  for (const Place& place : points) {
    Sample& sample = samples_[key(place)];
    if (sample.known) continue;
    const bool shared = place[0] % factor_ == 0 && place[1] % factor_ == 0 && place[2] % factor_ == 0;
    const int i = place[0] / factor_, j = place[1] / factor_, k = place[2] / factor_;
    if (shared && (coarse_.exact(i, j, k) || std::abs(coarse_.value(i, j, k)) >= SparseGrid::far))
      sample = {coarse_.value(i, j, k), coarse_.exact(i, j, k), true};
    else if (place[0] % 2 == 0 && place[1] % 2 == 0 && place[2] % 2 == 0)
      to_evaluate.push_back(place);
  }
  evaluate(to_evaluate, function);  // every other point of each axis first; they settle most of the others
  to_evaluate.clear();
  for (const Place& place : points) {
    Sample& sample = samples_[key(place)];
    if (!sample.known && !settle(place, sample, slope)) to_evaluate.push_back(place);
  }
  evaluate(to_evaluate, function);
  do {
    to_evaluate.clear();
    for (const Place& place : points) {
      const Sample& sample = samples_.at(key(place));
      if (sample.exact) continue;
      bool change = false;
      for (int axis = 0; axis < 3; ++axis)
        for (const int by : {-1, 1}) {
          const Place next = shifted(place, axis, by);
          if (next[axis] < 0) continue;
          const auto sample_at = samples_.find(key(next));
          change = change ||
                   (sample_at != samples_.end() && (sample_at->second.value < 0.0f) != (sample.value < 0.0f));
        }
      if (change) to_evaluate.push_back(place);
    }
    evaluate(to_evaluate, function);
  } while (!to_evaluate.empty());
}

}  // namespace arapfields
