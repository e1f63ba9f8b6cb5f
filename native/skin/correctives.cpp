// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/correctives.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>

#include "core/errors.h"
#include "core/parallel.h"
#include "skin/example_poses.h"

namespace arapfields {
namespace {

constexpr int features = 9;
using Features = Eigen::Matrix<double, features, 1>;
using Moments = Eigen::Matrix<double, features, features>;

constexpr std::uint64_t stream = 35;
constexpr int poses_per_feature = 8;
/// A joint matters where its bone and its parent move a vertex by this share at least.
constexpr float least_weight = 1e-3f;
/// Ridge of the regressions, as a share of the features' mean square.
constexpr double ridge = 1e-2;

Features features_of(const Mat3& rotation) {
  const Eigen::Quaterniond q(rotation);
  const double w = q.w(), x = q.x(), y = q.y(), z = q.z();
  return (Features() << w * x, w * y, w * z, x * x, y * y, z * z, x * y, x * z, y * z).finished();
}

/// What is left between skin and field at a mesh's vertices in example poses, taken back to rest.
struct Residuals {
  Eigen::MatrixXd values;                ///< (poses, bones · 9) the features
  std::vector<Eigen::MatrixXf> offsets;  ///< of each vertex (poses, 3)
};

Residuals residuals_of(const RigShape& rig, PointsIn vertices, const RowMatrix<float>& weights,
                       const SkinOptions& options, const Progress& progress) {
  const Index count = poses_per_feature * features;
  ExamplePoses poses(rig, vertices, options, progress.part(0.0, 0.1));
  Residuals result{Eigen::MatrixXd(count, rig.skeleton.count() * features), {}};
  result.offsets.assign(vertices.rows(), Eigen::MatrixXf(count, 3));
  Random random(options.seed, stream);
  const Vector always = Vector::Ones(rig.skeleton.count());
  for (Index p = 0; p < count; ++p) {
    progress.report(0.1 + 0.9 * static_cast<double>(p) / static_cast<double>(count), "Posing");
    const ExamplePose pose = poses.draw(random, always, progress);
    for (Index b = 0; b < rig.skeleton.count(); ++b)
      result.values.block<1, features>(p, b * features) = features_of(pose.rotations[b]);
    parallel_for(0, vertices.rows(), 256, [&](Index first, Index last) {
      for (Index i = first; i < last; ++i) {
        Eigen::Matrix<double, 3, 4> blend = Eigen::Matrix<double, 3, 4>::Zero();
        for (Index b = 0; b < rig.skeleton.count(); ++b)
          if (const float w = weights(i, rig.skeleton.original(b)); w > 0.0f)
            blend += static_cast<double>(w) * pose.motions[b].topRows<3>();
        const Vec3 rest = vertices.row(i), there = pose.shape.row(i).cast<double>();
        const Mat3 linear = blend.leftCols<3>();
        const Vec3 off = linear.inverse() * (there - linear * rest - blend.col(3));
        result.offsets[i].row(p) = (off.allFinite() ? off : Vec3::Zero()).cast<float>();
      }
    });
  }
  return result;
}

/// Ridge regression of a vertex's offsets (poses,3) on some columns of `values`: (columns, 3).
Eigen::MatrixXd regressed(const Eigen::MatrixXd& values, const std::vector<Index>& columns,
                          const Eigen::MatrixXf& offsets) {
  const Eigen::MatrixXd x = values(Eigen::all, columns);
  Eigen::MatrixXd square = x.transpose() * x;
  square.diagonal() *= 1.0 + ridge;
  square.diagonal().array() += 1e-12;
  return square.ldlt().solve(x.transpose() * offsets.cast<double>());
}

}  // namespace

double Corrective::value(const Mat3& rotation) const {
  return features_of(rotation).dot(Eigen::Map<const Features>(coefficients.data()));
}

std::vector<Corrective> skin_correctives(const TriangleMesh& mesh, const std::vector<Bone>& bones,
                                         const RowMatrix<float>& weights, const SkinOptions& options,
                                         const Progress& progress, const VertexWeights& painted) {
  options.validate();
  const ThreadScope threads(options.threads);
  require(weights.rows() == mesh.vertices.rows() && weights.cols() == static_cast<Index>(bones.size()),
          "weights", std::to_string(weights.rows()) + " by " + std::to_string(weights.cols()),
          "a row for each vertex and a column for each bone are needed");
  const RigShape rig(sample_mesh(mesh.vertices, mesh.triangles, options.samples, options.seed, painted),
                     bones, progress);
  const Skeleton& skeleton = rig.skeleton;
  const Index n = mesh.vertices.rows(), joints = skeleton.count();
  const Residuals left = residuals_of(rig, mesh.vertices, weights, options, progress.part(0.0, 0.7));
  // Where each joint matters.
  std::vector<std::vector<Index>> near(n);
  const auto moves = [&](Index i, Index b) {
    return b >= 0 && weights(i, skeleton.original(b)) > least_weight;
  };
  for (Index i = 0; i < n; ++i)
    for (Index b = 0; b < joints; ++b) {
      const Index parent = skeleton.bone(b).parent;
      if (parent >= 0 && (moves(i, b) || moves(i, parent))) near[i].push_back(b);
    }
  // All features of all joints: the directions of most effect, joint by joint.
  std::vector<Moments> effect(joints, Moments::Zero());
  for (Index i = 0; i < n; ++i) {
    if (i % 256 == 0)
      progress.report(0.7 + 0.2 * static_cast<double>(i) / static_cast<double>(n), "Correctives");
    if (near[i].empty()) continue;
    std::vector<Index> columns;
    for (const Index b : near[i])
      for (int f = 0; f < features; ++f) columns.push_back(b * features + f);
    const Eigen::MatrixXd slopes = regressed(left.values, columns, left.offsets[i]);
    for (std::size_t k = 0; k < near[i].size(); ++k) {
      const auto part = slopes.middleRows<features>(static_cast<Index>(k) * features);
      effect[near[i][k]] += part * part.transpose();
    }
  }
  struct Key {
    double gain;
    Index joint;
    Features coefficients;
  };
  std::vector<Key> keys;
  for (Index b = 0; b < joints; ++b) {
    if (skeleton.bone(b).parent < 0) continue;
    const auto x = left.values.middleCols<features>(b * features);
    const Moments moments = x.transpose() * x / static_cast<double>(x.rows());
    const Eigen::SelfAdjointEigenSolver<Moments> root(moments + 1e-12 * Moments::Identity());
    const Eigen::SelfAdjointEigenSolver<Moments> most(root.operatorSqrt() * effect[b] * root.operatorSqrt());
    for (int k = 0; k < features; ++k)
      keys.push_back({most.eigenvalues()[k], b, root.operatorInverseSqrt() * most.eigenvectors().col(k)});
  }
  std::ranges::stable_sort(keys, std::ranges::greater(), &Key::gain);
  keys.resize(std::min<std::size_t>(keys.size(), options.correctives));
  Eigen::MatrixXd values(left.values.rows(), static_cast<Index>(keys.size()));
  std::vector<Corrective> result;
  for (std::size_t k = 0; k < keys.size(); ++k) {
    const auto x = left.values.middleCols<features>(keys[k].joint * features);
    const double most = (x * keys[k].coefficients).cwiseAbs().maxCoeff();
    keys[k].coefficients /= std::max(most, 1e-12);
    values.col(static_cast<Index>(k)) = x * keys[k].coefficients;
    Corrective& corrective = result.emplace_back();
    corrective.bone = skeleton.original(keys[k].joint);
    Eigen::Map<Features>(corrective.coefficients.data()) = keys[k].coefficients;
    corrective.offsets = Points::Zero(n, 3);
  }
  // The keys' offsets together.
  parallel_for(0, n, 256, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      std::vector<Index> columns;
      for (std::size_t k = 0; k < keys.size(); ++k)
        if (std::ranges::find(near[i], keys[k].joint) != near[i].end())
          columns.push_back(static_cast<Index>(k));
      if (columns.empty()) continue;
      const Eigen::MatrixXd offsets = regressed(values, columns, left.offsets[i]);
      for (std::size_t k = 0; k < columns.size(); ++k)
        result[columns[k]].offsets.row(i) = offsets.row(static_cast<Index>(k));
    }
  });
  return result;
}

}  // namespace arapfields
