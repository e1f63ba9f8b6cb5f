// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/weight_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "core/parallel.h"

namespace arapfields {
namespace {

/// Support radius, in node spacings, and the factor on the weight of nodes on the other side.
constexpr double reach = 2.5, other_side = 1e-4;
/// Tikhonov term on the gradient, for points with few nodes nearby.
constexpr double damping = 0.05;
/// Least weight of a node; below it the point lies beside all nodes, and the weighted mean is used.
constexpr double most_negative = -0.25;

}  // namespace

VertexBlend::VertexBlend(const RigShape& rig, const PiecePoints& given, const std::vector<Index>& nearest)
    : entries_(given.points.rows()) {
  const Points &points = given.points, &normals = given.normals;
  const double width = reach * rig.spacing;
  parallel_for(0, points.rows(), 64, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Vec3 point = points.row(i), normal = normals.row(i);
      std::vector<Index> near = rig.nodes_within(point, width, given.pieces[i]);
      std::erase_if(near, [&](Index node) {
        return rig.are_apart(node, nearest[i]) ||
               !rig.tree.matters(rig.owners[node], rig.owners[nearest[i]], 0.0);
      });
      std::vector<Eigen::Vector4d> lines;
      std::vector<double> kernel;
      Eigen::Matrix4d moments = Eigen::Matrix4d::Zero();
      for (const Index node : near) {
        const Vec3 offset = (Vec3(rig.nodes.points.row(node)) - point) / width;
        const double side = normal.dot(rig.nodes.normals.row(node).transpose());
        const double falls = std::max(0.0, 1.0 - offset.squaredNorm());
        kernel.push_back(falls * falls * falls * std::max(other_side, std::min(1.0, 0.5 + side)));
        lines.push_back(Eigen::Vector4d(1.0, offset[0], offset[1], offset[2]));
        moments += kernel.back() * lines.back() * lines.back().transpose();
      }
      const double total = moments(0, 0);
      if (!(total > 10.0 * other_side)) {
        entries_[i] = {{nearest[i], 1.0f}};
        continue;
      }
      moments.diagonal().tail<3>().array() += damping * total;
      Eigen::Vector4d factor = moments.ldlt().solve(Eigen::Vector4d::UnitX());
      for (std::size_t k = 0; k < near.size(); ++k)
        if (kernel[k] * factor.dot(lines[k]) < most_negative) factor = Eigen::Vector4d::UnitX();
      for (std::size_t k = 0; k < near.size(); ++k)
        entries_[i].push_back({near[k], static_cast<float>(kernel[k] * factor.dot(lines[k]))});
      double sum = 0.0;
      for (const Entry& entry : entries_[i]) sum += static_cast<double>(entry.weight);
      for (Entry& entry : entries_[i]) entry.weight /= static_cast<float>(sum);
    }
  });
}

RowMatrix<float> VertexBlend::operator()(const RowMatrix<float>& values) const {
  RowMatrix<float> result = RowMatrix<float>::Zero(static_cast<Index>(entries_.size()), values.cols());
  parallel_for(0, result.rows(), 64, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      for (const Entry& entry : entries_[i]) result.row(i) += entry.weight * values.row(entry.node);
  });
  return result;
}

namespace {

constexpr int sweeps = 20;
/// Smoothing sweeps of the support over each node's neighbours.
constexpr int support_sweeps = 6;
/// Exponent of the cost of a bone by the ratio of the largest support left out to its own: infinite at 1.
constexpr double leaving_power = 4.0;

/// Weights of the `influences` bones with the largest support (`wanted`); they vanish continuously where a
/// bone is replaced by another.
FewBones among_wanted(const BonePairs& squares, double stiff, const FewBones& g, const FewBones& wanted,
                      int influences) {
  FewBones sorted = wanted;
  std::ranges::sort(sorted, std::greater<>());
  const double next = influences < sorted.size() ? std::max(sorted[influences], 0.0) : 0.0;
  std::vector<Index> used;
  for (Index j = 0; j < wanted.size(); ++j)
    if (wanted[j] > next) used.push_back(j);
  if (used.empty()) used.push_back(0);
  BonePairs h = squares(used, used);
  for (Index k = 0; k < h.rows(); ++k) {
    const double ratio =
        std::pow(next / std::max(wanted[used[static_cast<std::size_t>(k)]], 1e-12), leaving_power);
    h(k, k) *= 1.0 + ratio / std::max(1.0 - ratio, 1e-6);
  }
  h.diagonal().array() += stiff;
  const FewBones w = simplex_minimum(h, g(used), influences);
  FewBones result = FewBones::Zero(wanted.size());
  for (std::size_t k = 0; k < used.size(); ++k) result[used[k]] = w[static_cast<Index>(k)];
  return result;
}

}  // namespace

WeightFit::WeightFit(const RigShape& rig)
    : rig_(rig), weights_(RowMatrix<float>::Zero(rig.size(), rig.skeleton.count())) {
  std::vector<Index> all(rig.size());
  std::iota(all.begin(), all.end(), Index{0});
  const LimbSides limbs(rig, rig.nodes, all, rig.bone_distances);
  for (Index i = 0; i < rig.size(); ++i) {
    choices_.emplace_back(rig, i, rig.bone_distances.row(i), limbs.sides[i], limbs.shares[i]);
    squares_.push_back(BonePairs::Zero(choices_[i].count(), choices_[i].count()));
    weights_(i, choices_[i].bones.front()) = 1.0f;
  }
}

void WeightFit::add(const ExamplePose& pose) {
  ++poses_;
  parallel_for(0, rig_.size(), 64, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i)
      squares_[i] += choices_[i].square(rig_.nodes.points.row(i), pose.motions,
                                        pose.shape.row(i).cast<double>(), rig_.extent);
  });
}

FewBones WeightFit::minimum(Index node, double smoothness, int influences) const {
  const BoneChoice& choice = choices_[node];
  const double stiff = smoothness * smoothness_weight;
  BonePairs h = choice.held_back(squares_[node]) * (rig_.trust[node] / static_cast<double>(poses_));
  h.diagonal().array() += stiff;
  FewBones g = -choice.penalties;
  for (Index j = 0; j < choice.count(); ++j)
    for (const auto& [other, weight] : rig_.neighbours[node])
      g[j] += stiff * weight * static_cast<double>(weights_(other, choice.bones[j]));
  return simplex_minimum(h, g, influences);
}

void WeightFit::solve(double smoothness, const Progress& progress) {
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    progress.report(static_cast<double>(sweep) / sweeps);
    for (Index i = 0; i < rig_.size(); ++i) {
      const FewBones w = minimum(i, smoothness, static_cast<int>(most_candidates));
      for (Index j = 0; j < w.size(); ++j) weights_(i, choices_[i].bones[j]) = static_cast<float>(w[j]);
    }
  }
}

RowMatrix<float> WeightFit::support(double smoothness, int influences) const {
  RowMatrix<float> result = RowMatrix<float>::Zero(weights_.rows(), weights_.cols());
  parallel_for(0, rig_.size(), 64, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      const FewBones w = minimum(i, smoothness, influences);
      for (Index j = 0; j < w.size(); ++j) result(i, choices_[i].bones[j]) = static_cast<float>(w[j]);
    }
  });
  for (int sweep = 0; sweep < support_sweeps; ++sweep) {
    const RowMatrix<float> before = result;
    for (Index i = 0; i < rig_.size(); ++i)
      for (const auto& [other, weight] : rig_.neighbours[i])
        result.row(i) += static_cast<float>(weight) * before.row(other);
    result *= 0.5f;
  }
  return result;
}

Vector WeightFit::squared_errors(const ExamplePose& pose) const {
  Vector result(rig_.size());
  for (Index i = 0; i < rig_.size(); ++i) {
    Vec3 off = -pose.shape.row(i).cast<double>();
    for (const Index b : choices_[i].bones)
      off += static_cast<double>(weights_(i, b)) *
             (pose.motions[b] * rig_.nodes.points.row(i).transpose().homogeneous()).head<3>();
    result[i] = off.squaredNorm() / (rig_.extent * rig_.extent);
  }
  return result;
}

RowMatrix<float> point_weights(const RigShape& rig, const SkinPoints& points, const LimbSides& limbs,
                               const std::vector<ExamplePose>& poses, const SkinOptions& options) {
  const auto& [places, near, weights, support, distances, twins] = points;
  RowMatrix<float> result = RowMatrix<float>::Zero(places.rows(), rig.skeleton.count());
  const double stiff = options.smoothness * smoothness_weight;
  parallel_for(0, places.rows(), 16, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      const BoneChoice choice(rig, near[i], distances.row(i), limbs.sides[i], limbs.shares[i]);
      const Index twin = twins.like(i), k = choice.count();
      BoneChoice other = choice;
      if (twin >= 0)
        for (Index& bone : other.bones) bone = twins.bones[bone];
      BonePairs h = BonePairs::Zero(k, k);
      for (const ExamplePose& pose : poses) {
        const auto square = [&](const BoneChoice& bones, Index point) {
          return bones.square(places.row(point), pose.motions,
                              pose.shape.row(rig.size() + point).cast<double>(), rig.extent);
        };
        h += twin < 0 ? square(choice, i) : BonePairs(0.5 * (square(choice, i) + square(other, twin)));
      }
      h = choice.held_back(h) * (rig.trust[near[i]] / static_cast<double>(poses.size()));
      FewBones g = -choice.penalties, wanted(k);
      for (Index j = 0; j < k; ++j) {
        g[j] += stiff * static_cast<double>(weights(i, choice.bones[j]));
        wanted[j] = static_cast<double>(support(i, choice.bones[j]));
      }
      const FewBones w = among_wanted(h, stiff, g, wanted, options.influences);
      for (Index j = 0; j < k; ++j) result(i, choice.bones[j]) = static_cast<float>(w[j]);
    }
  });
  return result;
}

}  // namespace arapfields
