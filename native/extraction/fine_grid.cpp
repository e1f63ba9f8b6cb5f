// SPDX-License-Identifier: GPL-3.0-or-later
#include "extraction/fine_grid.h"

#include <algorithm>
#include <cmath>

namespace arapfields {
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
