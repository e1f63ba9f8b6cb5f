// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/weight_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>

#include "core/parallel.h"

namespace arapfields {
namespace {

/// A bone matters where it is at most so many times as far as the nearest, through the inside.
constexpr float farthest_share = 6.0f;
/// The same for bones of other limbs, which no line of ancestors joins to the nearest one.
constexpr float side_share = 2.5f;
constexpr Index most_joints = 3;  ///< between a bone that matters and the nearest
constexpr int sweeps = 25;
/// Weight of the smoothness at option 1, and of the distances of bones of the limb and of others; for lengths
/// in sizes of the shape.
constexpr double smoothness_weight = 3e-4, distance_weight = 2e-6, side_weight = 1e-5;
/// Of the sum of one.
constexpr double sum_weight = 10.0;

using Square = WeightFit::Square;
using Few = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, WeightFit::most_candidates, 1>;

/// argmin of wᵀHw/2 − gᵀw over w ≥ 0 (Lawson, Hanson 1974, chapter 23, on the normal equations).
Few non_negative(const Square& h, const Few& g) {
  const Index n = g.size();
  Few w = Few::Zero(n);
  std::vector<Index> free;
  const auto solve_free = [&] {
    Square part(free.size(), free.size());
    Few right(free.size());
    for (std::size_t i = 0; i < free.size(); ++i) {
      right[i] = g[free[i]];
      for (std::size_t j = 0; j < free.size(); ++j) part(i, j) = h(free[i], free[j]);
    }
    return Few(part.ldlt().solve(right));
  };
  for (Index round = 0; round < 3 * n; ++round) {
    const Few dual = g - h * w;
    Index entering = -1;
    for (Index i = 0; i < n; ++i)
      if (std::ranges::find(free, i) == free.end() &&
          dual[i] > 1e-10 * std::max(1.0, g.cwiseAbs().maxCoeff()) &&
          (entering < 0 || dual[i] > dual[entering]))
        entering = i;
    if (entering < 0) break;
    free.push_back(entering);
    while (!free.empty()) {
      const Few next = solve_free();
      double step = 1.0;
      for (std::size_t i = 0; i < free.size(); ++i)
        if (next[i] <= 0.0) step = std::min(step, w[free[i]] / std::max(w[free[i]] - next[i], 1e-300));
      for (std::size_t i = 0; i < free.size(); ++i) w[free[i]] += step * (next[i] - w[free[i]]);
      if (step >= 1.0) break;
      std::erase_if(free, [&](Index i) {
        if (w[i] > 1e-12) return false;
        w[i] = 0.0;
        return true;
      });
    }
  }
  return w;
}

}  // namespace

WeightFit::WeightFit(const RigShape& rig) : rig_(rig), squares_(rig.size()) {
  choose_candidates();
  weights_ = RowMatrix<float>::Zero(rig.size(), rig.skeleton.count());
  for (Index i = 0; i < rig.size(); ++i) {
    const Index k = static_cast<Index>(candidates_[i].size());
    squares_[i] = Square::Zero(k, k);
    weights_(i, candidates_[i].front()) = 1.0f;
  }
}

void WeightFit::choose_candidates() {
  candidates_.resize(rig_.size());
  std::vector<Index> all(rig_.skeleton.count());
  for (Index i = 0; i < rig_.size(); ++i) {
    std::iota(all.begin(), all.end(), Index{0});
    const auto distances = rig_.bone_distances.row(i);
    const Index count = std::min<Index>(most_candidates, rig_.skeleton.count());
    std::ranges::partial_sort(all, all.begin() + count, {}, [&](Index b) { return distances[b]; });
    const float least = std::max(distances[all.front()], static_cast<float>(rig_.spacing));
    for (Index k = 0; k < count; ++k) {
      const bool line = rig_.skeleton.in_line(all[k], all[0]);
      if (k == 0 || (distances[all[k]] < (line ? farthest_share : side_share) * least &&
                     rig_.skeleton.joints_between(all[k], all[0]) <= most_joints))
        candidates_[i].push_back(all[k]);
    }
  }
}

void WeightFit::add(const ExamplePose& pose) {
  ++poses_;
  parallel_for(0, rig_.size(), 64, [&](Index first, Index last) {
    Eigen::Matrix<double, 3, Eigen::Dynamic> off;
    for (Index i = first; i < last; ++i) {
      const Candidates& bones = candidates_[i];
      const Vec3 node = rig_.nodes.row(i), there = pose.shape.row(i).cast<double>();
      off.resize(3, static_cast<Index>(bones.size()));
      for (std::size_t k = 0; k < bones.size(); ++k)
        off.col(k) = ((pose.motions[bones[k]] * node.homogeneous()).head<3>() - there) / rig_.extent;
      squares_[i] += off.transpose() * off;
    }
  });
}

void WeightFit::update(Index node, int influences, double smoothness) {
  const Candidates& bones = candidates_[node];
  const Index k = static_cast<Index>(bones.size());
  if (k == 1) return;
  const double stiff = smoothness * smoothness_weight;
  Square h = squares_[node] / static_cast<double>(poses_);
  h.diagonal().array() += stiff;
  Few g = Few::Zero(k);
  const double nearest = std::max<double>(rig_.bone_distances(node, bones.front()), rig_.spacing);
  for (Index j = 0; j < k; ++j) {
    for (const auto& [other, weight] : rig_.neighbours[node])
      g[j] += stiff * weight * static_cast<double>(weights_(other, bones[j]));
    const double farther = static_cast<double>(rig_.bone_distances(node, bones[j])) / nearest - 1.0;
    const bool line = rig_.skeleton.in_line(bones[j], bones.front());
    g[j] -= (line ? distance_weight : side_weight) * farther * farther;
  }
  // The sum of one as a heavy row.
  const double scale = sum_weight * h.diagonal().mean();
  h.array() += scale;
  g.array() += scale;
  Few w = non_negative(h / scale, g / scale);
  std::vector<Index> largest(k);
  std::iota(largest.begin(), largest.end(), Index{0});
  std::ranges::stable_sort(largest, std::ranges::greater(), [&](Index j) { return w[j]; });
  if (k > influences && w[largest[influences]] > 0.0) {
    for (Index j = influences; j < k; ++j) {  // bones that may not enter
      h.row(largest[j]).setZero();
      h.col(largest[j]).setZero();
      h(largest[j], largest[j]) = scale;
      g[largest[j]] = 0.0;
    }
    w = non_negative(h / scale, g / scale);
  }
  w /= w.sum();
  for (Index j = 0; j < k; ++j) weights_(node, bones[j]) = static_cast<float>(w[j]);
}

void WeightFit::solve(int influences, double smoothness, const Progress& progress) {
  const int all = static_cast<int>(most_candidates);
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    progress.report(static_cast<double>(sweep) / sweeps);
    // The last sweeps keep few bones.
    for (Index i = 0; i < rig_.size(); ++i) update(i, sweep < sweeps - 5 ? all : influences, smoothness);
  }
}

Vector WeightFit::squared_errors(const ExamplePose& pose) const {
  Vector result(rig_.size());
  for (Index i = 0; i < rig_.size(); ++i) {
    Vec3 off = -pose.shape.row(i).cast<double>();
    for (const Index b : candidates_[i])
      off += static_cast<double>(weights_(i, b)) *
             (pose.motions[b] * rig_.nodes.row(i).transpose().homogeneous()).head<3>();
    result[i] = off.squaredNorm() / (rig_.extent * rig_.extent);
  }
  return result;
}

double WeightFit::mean_squared_error() const {
  double total = 0.0;
  for (Index i = 0; i < rig_.size(); ++i) {
    Vector w(static_cast<Index>(candidates_[i].size()));
    for (Index j = 0; j < w.size(); ++j) w[j] = static_cast<double>(weights_(i, candidates_[i][j]));
    total += w.dot(squares_[i] * w);
  }
  return total / static_cast<double>(rig_.size() * std::max<Index>(poses_, 1));
}

}  // namespace arapfields
