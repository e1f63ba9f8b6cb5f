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
#include "skin/mirror.h"

namespace arapfields {
namespace {

constexpr int features = 9;
using Features = Eigen::Matrix<double, features, 1>;
using Moments = Eigen::Matrix<double, features, features>;

constexpr std::uint64_t stream = 35;
constexpr int poses_per_feature = 8;
/// A joint matters where its bone and its parent move a vertex by this share at least.
constexpr float least_weight = 1e-3f;
/// Vertices by which keys are chosen.
constexpr Index most_seen = 8000;
/// Ridge of the regressions, as a share of the features' mean square.
constexpr double ridge = 1e-2;

Features features_of(const Mat3& rotation) {
  const Eigen::Quaterniond q(rotation);
  const double w = q.w(), x = q.x(), y = q.y(), z = q.z();
  return (Features() << w * x, w * y, w * z, x * x, y * y, z * z, x * y, x * z, y * z).finished();
}

/// What is left between skin and field at a mesh's vertices in example poses, taken back to rest.
struct Residuals {
  std::vector<std::vector<Mat3>> rotations;  ///< of the joints, of each pose
  std::vector<Eigen::MatrixXf> offsets;      ///< of each vertex (poses, 3)
};

Residuals residuals_of(const RigShape& rig, PointsIn vertices, const RowMatrix<float>& weights,
                       const SkinOptions& options, const Progress& progress) {
  const Index count = poses_per_feature * features;
  ExamplePoses poses(rig, vertices, options, progress.part(0.0, 0.1));
  Residuals result;
  result.offsets.assign(vertices.rows(), Eigen::MatrixXf(count, 3));
  Random random(options.seed, stream);
  const Vector always = Vector::Ones(rig.skeleton.count());
  for (Index p = 0; p < count; ++p) {
    progress.report(0.1 + 0.9 * static_cast<double>(p) / static_cast<double>(count), "Posing");
    const ExamplePose pose = poses.draw(random, always, progress);
    result.rotations.push_back(pose.rotations);
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

/// A rig's symmetry as the poses and keys see it. Without one, nothing is mirrored.
struct Reflection {
  Reflection(const RigShape& rig, PointsIn points) : mirror(rig, points), signs(Vec3::Ones()) {
    signs[rig.symmetry.axis] = -1.0;
    for (Index b = 0; b < rig.skeleton.count() && !mirror.bones.empty(); ++b)
      turns.push_back(-bone_axes(rig.skeleton.bone(mirror.bones[b])).transpose() * signs.asDiagonal() *
                      bone_axes(rig.skeleton.bone(b)));
  }
  Index twin(Index b) const { return mirror.bones.empty() ? b : mirror.bones[b]; }
  /// The mirrored polynomial, of the mirrored joint.
  Features operator()(Index b, const Features& c) const {
    Mat3 square;
    square << c[3], c[6] / 2, c[7] / 2, c[6] / 2, c[4], c[8] / 2, c[7] / 2, c[8] / 2, c[5];
    const Mat3 q = turns[b] * square * turns[b].transpose();
    return (Features() << turns[b] * c.head<3>(), q(0, 0), q(1, 1), q(2, 2), 2 * q(0, 1), 2 * q(0, 2),
            2 * q(1, 2))
        .finished();
  }

  Mirror mirror;
  Vec3 signs;
  std::vector<Mat3> turns;  ///< a joint's axes → those of its twin, without the reflection
};

/// Features (poses, joints · 9); a symmetric rig's mirrored poses follow.
Eigen::MatrixXd values_of(const std::vector<std::vector<Mat3>>& rotations, const Reflection& reflection) {
  const Index count = static_cast<Index>(rotations.size());
  const auto joints = static_cast<Index>(rotations.front().size());
  const bool symmetric = !reflection.turns.empty();
  Eigen::MatrixXd result(symmetric ? 2 * count : count, joints * features);
  for (Index p = 0; p < count; ++p)
    for (Index b = 0; b < joints; ++b) {
      const Mat3& turn = rotations[p][b];
      result.block<1, features>(p, b * features) = features_of(turn);
      if (symmetric)
        result.block<1, features>(count + p, reflection.twin(b) * features) =
            features_of(reflection.turns[b] * turn * reflection.turns[b].transpose());
    }
  return result;
}

/// A vertex's offsets in all poses; a twin's, reflected, are those in the mirrored ones.
Eigen::MatrixXf offsets_of(const Residuals& left, const Reflection& reflection, Index i) {
  const Index twin = reflection.mirror.twin(i);
  if (twin < 0) return left.offsets[i];
  Eigen::MatrixXf result(2 * left.offsets[i].rows(), 3);
  result << left.offsets[i], left.offsets[twin] * reflection.signs.cast<float>().asDiagonal();
  return result;
}

/// Ridge regression of vertices' offsets on columns of `values` (poses, all columns).
struct Regression {
  explicit Regression(const Eigen::MatrixXd& all, Index first)
      : values(all),
        own(first),
        whole(all.transpose() * all),
        half(all.topRows(first).transpose() * all.topRows(first)) {}

  /// (columns, 3), from the offsets (poses, 3) in all poses or in the first.
  Eigen::MatrixXd operator()(const std::vector<Index>& columns, const Eigen::MatrixXf& offsets) const {
    Eigen::MatrixXd square = (offsets.rows() == own ? half : whole)(columns, columns);
    square.diagonal() *= 1.0 + ridge;
    square.diagonal().array() += 1e-12;
    const Eigen::MatrixXd x = values(Eigen::seqN(0, offsets.rows()), columns);
    return square.ldlt().solve(x.transpose() * offsets.cast<double>());
  }

  const Eigen::MatrixXd& values;
  Index own;
  Eigen::MatrixXd whole, half;
};

/// A polynomial of one joint's rotation, and how much of what is left it takes.
struct Key {
  double gain;
  Index joint;
  Features coefficients;
};

/// The keys of most effect, at most so many; those of twins come together.
std::vector<Key> chosen_keys(const Skeleton& skeleton, const Eigen::MatrixXd& values,
                             const std::vector<Moments>& effect, const Reflection& reflection, int most) {
  std::vector<Key> all, result;
  for (Index b = 0; b < skeleton.count(); ++b) {
    if (skeleton.bone(b).parent < 0 || reflection.twin(b) < b) continue;
    const auto x = values.middleCols<features>(b * features);
    const Moments moments = x.transpose() * x / static_cast<double>(x.rows());
    const Eigen::SelfAdjointEigenSolver<Moments> root(moments + 1e-12 * Moments::Identity());
    Moments gains = effect[b];
    if (!reflection.turns.empty() && reflection.twin(b) == b) {  // keys become even or odd
      Moments swap;
      for (int f = 0; f < features; ++f) swap.col(f) = reflection(b, Features::Unit(f));
      gains = 0.5 * (gains + swap * gains * swap.transpose()).eval();
    }
    const Eigen::SelfAdjointEigenSolver<Moments> main(root.operatorSqrt() * gains * root.operatorSqrt());
    for (int k = 0; k < features; ++k) {
      Features c = root.operatorInverseSqrt() * main.eigenvectors().col(k);
      c /= std::max((x * c).cwiseAbs().maxCoeff(), 1e-12);
      all.push_back({main.eigenvalues()[k], b, c});
    }
  }
  std::ranges::stable_sort(all, std::ranges::greater(), &Key::gain);
  for (const Key& key : all) {
    const Index twin = reflection.twin(key.joint);
    if (static_cast<int>(result.size()) + (twin == key.joint ? 1 : 2) > most) continue;
    result.push_back(key);
    if (twin != key.joint) result.push_back({key.gain, twin, reflection(key.joint, key.coefficients)});
  }
  return result;
}

}  // namespace

double Corrective::value(const Mat3& rotation) const {
  const double value = features_of(rotation).dot(Eigen::Map<const Features>(coefficients.data()));
  return std::clamp(value, -1.0, 1.0);
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
  const Reflection reflection(rig, mesh.vertices);
  const Eigen::MatrixXd all = values_of(left.rotations, reflection);
  const auto poses = static_cast<Index>(left.rotations.size());
  const Regression on_all(all, poses);
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
  for (Index i = 0, step = 1 + n / most_seen; i < n; i += step) {
    if (i % 256 < step)
      progress.report(0.7 + 0.2 * static_cast<double>(i) / static_cast<double>(n), "Correctives");
    if (near[i].empty()) continue;
    std::vector<Index> columns;
    for (const Index b : near[i])
      for (int f = 0; f < features; ++f) columns.push_back(b * features + f);
    const Eigen::MatrixXd slopes = on_all(columns, offsets_of(left, reflection, i));
    for (std::size_t k = 0; k < near[i].size(); ++k) {
      const auto part = slopes.middleRows<features>(static_cast<Index>(k) * features);
      effect[near[i][k]] += part * part.transpose();
    }
  }
  const std::vector<Key> keys = chosen_keys(skeleton, all, effect, reflection, options.correctives);
  Eigen::MatrixXd values(all.rows(), static_cast<Index>(keys.size()));
  std::vector<Corrective> result(keys.size());
  for (std::size_t k = 0; k < keys.size(); ++k) {
    values.col(static_cast<Index>(k)) =
        all.middleCols<features>(keys[k].joint * features) * keys[k].coefficients;
    result[k].bone = skeleton.original(keys[k].joint);
    Eigen::Map<Features>(result[k].coefficients.data()) = keys[k].coefficients;
    result[k].offsets = Points::Zero(n, 3);
  }
  // The keys' offsets together.
  const Regression on_keys(values, poses);
  parallel_for(0, n, 256, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      std::vector<Index> columns;
      for (std::size_t k = 0; k < keys.size(); ++k)
        if (std::ranges::find(near[i], keys[k].joint) != near[i].end())
          columns.push_back(static_cast<Index>(k));
      if (columns.empty()) continue;
      const Eigen::MatrixXd offsets = on_keys(columns, offsets_of(left, reflection, i));
      for (std::size_t k = 0; k < columns.size(); ++k)
        result[columns[k]].offsets.row(i) = offsets.row(static_cast<Index>(k));
    }
  });
  return result;
}

}  // namespace arapfields
