// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/vertex_blend.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>

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
      std::erase_if(
          near, [&](Index node) { return !rig.tree.matters(rig.owners[node], rig.owners[nearest[i]], 0.0); });
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

}  // namespace arapfields
