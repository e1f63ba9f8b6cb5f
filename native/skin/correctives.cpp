// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/correctives.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <map>
#include <utility>
#include <vector>

#include "core/decompositions.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "core/task.h"
#include "distance/welded_vertices.h"
#include "mesh/outward_triangles.h"
#include "options/skin.h"
#include "skin/example_poses.h"
#include "skin/fine_parts.h"
#include "skin/rig_shape.h"

namespace arapfields {

/// Products of the entries of a joint's unit quaternion (w, x, y, z): wx, wy, wz, xx, yy, zz, xy, xz, yz.
constexpr int joint_features = 9;
using JointFeatures = Eigen::Matrix<double, joint_features, 1>;
using FeaturePairs = Eigen::MatrixXd;  ///< (9,9)

JointFeatures joint_features_of(const Mat3& rotation);

/// The reflection of poses and shape keys by a rig's symmetry. Without one, nothing is mirrored.
struct Reflection {
  Reflection(const RigShape& rig, PointsIn points);

  bool exists() const { return !maps.empty(); }
  Index twin(Index joint) const { return exists() ? mirror.bones[joint] : joint; }
  /// The mirrored polynomial, of the mirrored joint.
  JointFeatures polynomial(Index joint, const JointFeatures& coefficients) const {
    return maps[twin(joint)].transpose() * coefficients;
  }

  RigTwins mirror;
  Vec3 signs;
  std::vector<FeaturePairs> maps;  ///< features of a joint → its twin's in the mirrored pose
};

/// Ridge regression of the residuals between skin and field, taken back to rest, on the joints' features over
/// example poses. A vertex depends on nearby joints alone.
class CorrectiveFit {
 public:
  /// Vertices that depend on the same joints.
  struct Region {
    std::vector<Index> joints;
    std::vector<Index> vertices;
    bool mirrored;  ///< whether mirrored poses enter the regression too
  };

  /// Vertices (n,3), weights (n, bones), and how far the field's shape is to be trusted at each vertex (n);
  /// throws Cancelled.
  CorrectiveFit(const RigShape& rig, PointsIn vertices, const Vector& trust, const RowMatrix<float>& weights,
                const SkinOptions& options, const Progress& progress);

  /// Regression coefficients (columns, 3 · vertices) of every step-th vertex of a region, on polynomials
  /// (the region's features, columns).
  Eigen::MatrixXd slopes(const Region& region, const Eigen::MatrixXd& polynomials, Index step = 1) const;

  Reflection reflection;
  std::vector<Region> regions;
  Eigen::MatrixXd values;  ///< features (poses, joints · 9), then those of the mirrored poses

 private:
  void find_regions(const Skeleton& skeleton, const RowMatrix<float>& weights);
  Eigen::MatrixXd right(const Region& region, Index vertex) const;

  std::vector<Index> region_of_;        // of each vertex; −1 for none
  std::vector<Eigen::MatrixXf> right_;  // of each vertex, features times offsets over the poses
  Eigen::MatrixXd square_;
  Eigen::MatrixXd mirrored_square_;
};

namespace {

constexpr std::uint64_t pose_stream = 35;
/// Example poses for each feature of the regression, and bounds of their number.
constexpr Index poses_per_feature = 4, least_poses = 36, most_poses = 288;
/// Skin weight above which a bone moves a vertex.
constexpr float least_weight = 1e-3f;
/// A vertex depends on bones within so many steps in the tree of those that move it.
constexpr int joint_steps = 2;
/// Ridge of the regressions, as a fraction of the features' mean square.
constexpr double ridge = 0.03;
/// Most vertices of a region, which is a unit of parallel work.
constexpr std::size_t region_size = 512;
/// The entries of a symmetric matrix (3,3) in the order of the features.
constexpr std::array<std::pair<int, int>, 6> entries{{{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};

/// The linear map (9,9) of a joint's features under a rotation of its axes.
FeaturePairs turned(const Mat3& turn) {
  FeaturePairs result = FeaturePairs::Zero(joint_features, joint_features);
  result.topLeftCorner<3, 3>() = turn;
  for (std::size_t f = 0; f < entries.size(); ++f) {
    const auto [j, k] = entries[f];
    Mat3 both = turn.col(j) * turn.col(k).transpose();
    if (j != k) both += both.transpose().eval();
    for (std::size_t g = 0; g < entries.size(); ++g)
      result(3 + static_cast<Index>(g), 3 + static_cast<Index>(f)) =
          both(entries[g].first, entries[g].second);
  }
  return result;
}

std::vector<Index> columns_of(const std::vector<Index>& joints) {
  std::vector<Index> result;
  for (const Index b : joints)
    for (int f = 0; f < joint_features; ++f) result.push_back(b * joint_features + f);
  return result;
}

}  // namespace

JointFeatures joint_features_of(const Mat3& rotation) {
  const Eigen::Quaterniond q(rotation);
  const double w = q.w(), x = q.x(), y = q.y(), z = q.z();
  return (JointFeatures() << w * x, w * y, w * z, x * x, y * y, z * z, x * y, x * z, y * z).finished();
}

Reflection::Reflection(const RigShape& rig, PointsIn points) : mirror(rig, points), signs(Vec3::Ones()) {
  signs[rig.symmetry.axis] = -1.0;
  for (Index b = 0; b < rig.skeleton.count() && !mirror.bones.empty(); ++b)
    maps.push_back(turned(-bone_axes(rig.skeleton.bone(mirror.bones[b])).transpose() * signs.asDiagonal() *
                          bone_axes(rig.skeleton.bone(b))));
}

CorrectiveFit::CorrectiveFit(const RigShape& rig, PointsIn vertices, const Vector& trust,
                             const RowMatrix<float>& weights, const SkinOptions& options,
                             const Progress& progress)
    : reflection(rig, vertices), region_of_(vertices.rows(), -1), right_(vertices.rows()) {
  const Skeleton& skeleton = rig.skeleton;
  find_regions(skeleton, weights);
  const Index joints = skeleton.count(), n = vertices.rows();
  Index near = 0;
  for (const Region& region : regions) near = std::max(near, static_cast<Index>(region.joints.size()));
  const Index poses = std::clamp(poses_per_feature * joint_features * near, least_poses, most_poses);
  values.setZero((reflection.exists() ? 2 : 1) * poses, joints * joint_features);
  std::vector<std::vector<Index>> movers(n);
  for (Index i = 0; i < n; ++i) {
    for (Index b = 0; b < joints; ++b)
      if (weights(i, skeleton.original(b)) > 0.0f) movers[i].push_back(b);
    if (region_of_[i] >= 0)
      right_[i].setZero(static_cast<Index>(regions[region_of_[i]].joints.size()) * joint_features, 3);
  }
  ExamplePoses examples(rig, vertices, options, progress.part(0.0, 0.1));
  Random random(options.seed, pose_stream);
  const Vector always = Vector::Ones(joints);
  for (Index p = 0; p < poses; ++p) {
    progress.report(0.1 + 0.9 * static_cast<double>(p) / static_cast<double>(poses), "Posing");
    const ExamplePose pose = examples.draw(random, always, progress);
    for (Index b = 0; b < joints; ++b) {
      const JointFeatures features = joint_features_of(pose.rotations[b]);
      values.block<1, joint_features>(p, b * joint_features) = features;
      if (reflection.exists())
        values.block<1, joint_features>(poses + p, reflection.twin(b) * joint_features) =
            reflection.maps[b].lazyProduct(features);
    }
    const Eigen::VectorXf features = values.row(p).cast<float>();
    parallel_for(0, n, 256, [&](Index first, Index last) {
      for (Index i = first; i < last; ++i) {
        if (region_of_[i] < 0) continue;
        Eigen::Matrix<double, 3, 4> blend = Eigen::Matrix<double, 3, 4>::Zero();
        for (const Index b : movers[i])
          blend += static_cast<double>(weights(i, skeleton.original(b))) * pose.motions[b].topRows<3>();
        const Vec3 rest = vertices.row(i), there = pose.shape.row(i).cast<double>();
        const Mat3 linear = blend.leftCols<3>();
        const Vec3 off = linear.inverse() * (there - linear * rest - blend.col(3));
        if (!off.allFinite()) continue;
        const auto trusted = static_cast<float>(trust[i]);
        Index row = 0;
        for (const Index b : regions[region_of_[i]].joints) {
          right_[i].middleRows<joint_features>(row) += features.segment<joint_features>(b * joint_features) *
                                                       (trusted * off.cast<float>()).transpose();
          row += joint_features;
        }
      }
    });
  }
  const Eigen::MatrixXd own = values.topRows(poses), others = values.bottomRows(values.rows() - poses);
  square_ = transposed_product(own, own);
  mirrored_square_ = transposed_product(others, others);
}

void CorrectiveFit::find_regions(const Skeleton& skeleton, const RowMatrix<float>& weights) {
  const auto moves = [&](Index i, Index b) {
    const Index twin = reflection.mirror.twin(i);
    return weights(i, skeleton.original(b)) > least_weight ||
           (twin >= 0 && weights(twin, skeleton.original(reflection.twin(b))) > least_weight);
  };
  std::map<std::pair<std::vector<Index>, bool>, Index> last;
  for (Index i = 0; i < weights.rows(); ++i) {
    std::vector<bool> near(skeleton.count(), false);
    for (Index b = 0; b < skeleton.count(); ++b) near[b] = moves(i, b);
    for (int step = 0; step < joint_steps; ++step) {
      const std::vector<bool> before = near;
      for (Index b = 0; b < skeleton.count(); ++b)
        if (const Index parent = skeleton.bone(b).parent; parent >= 0) {
          if (before[parent]) near[b] = true;
          if (before[b]) near[parent] = true;
        }
    }
    std::vector<Index> joints;
    for (Index b = 0; b < skeleton.count(); ++b)
      if (near[b] && skeleton.bone(b).parent >= 0) joints.push_back(b);
    if (joints.empty()) continue;
    const bool mirrored = reflection.mirror.twin(i) >= 0;
    Index& region = last.try_emplace({joints, mirrored}, -1).first->second;
    if (region < 0 || regions[region].vertices.size() == region_size) {
      region = static_cast<Index>(regions.size());
      regions.push_back({std::move(joints), {}, mirrored});
    }
    regions[region].vertices.push_back(i);
    region_of_[i] = region;
  }
}

/// Features times residuals over the poses; those of mirrored poses are the twin vertex's, reflected.
Eigen::MatrixXd CorrectiveFit::right(const Region& region, Index vertex) const {
  Eigen::MatrixXd result = right_[vertex].cast<double>();
  if (!region.mirrored) return result;
  const Index twin = reflection.mirror.twin(vertex);
  if (region_of_[twin] < 0) return result;
  const std::vector<Index>& joints = regions[region_of_[twin]].joints;
  for (std::size_t k = 0; k < region.joints.size(); ++k) {
    const Index joint = reflection.twin(region.joints[k]);
    const auto at = std::ranges::find(joints, joint) - joints.begin();
    if (at == static_cast<Index>(joints.size())) continue;
    result.middleRows<joint_features>(static_cast<Index>(k) * joint_features) +=
        product(reflection.maps[joint],
                right_[twin].middleRows<joint_features>(at * joint_features).cast<double>()) *
        reflection.signs.asDiagonal();
  }
  return result;
}

Eigen::MatrixXd CorrectiveFit::slopes(const Region& region, const Eigen::MatrixXd& polynomials,
                                      Index step) const {
  const std::vector<Index> columns = columns_of(region.joints);
  Eigen::MatrixXd square = square_(columns, columns);
  if (region.mirrored) square += mirrored_square_(columns, columns);
  square = product(transposed_product(polynomials, square), polynomials);
  square.diagonal() *= 1.0 + ridge;
  square.diagonal().array() += 1e-12;
  const Index count = (static_cast<Index>(region.vertices.size()) + step - 1) / step;
  Eigen::MatrixXd rights(polynomials.cols(), 3 * count);
  for (Index k = 0; k < count; ++k)
    rights.middleCols<3>(3 * k) = transposed_product(polynomials, right(region, region.vertices[k * step]));
  return solve_definite(square, rights);
}

namespace {

/// Most vertices by which keys are chosen.
constexpr Index most_seen = 8000;

/// A polynomial of one joint's rotation, and its reduction of the squared residual.
struct Key {
  double gain;
  Index joint;
  JointFeatures coefficients;
};

/// The keys of largest gain, at most `most`; those of twin bones are chosen together.
std::vector<Key> chosen_keys(const Skeleton& skeleton, const CorrectiveFit& fit,
                             const std::vector<FeaturePairs>& effect, int most) {
  const Reflection& reflection = fit.reflection;
  std::vector<Key> all, result;
  for (Index b = 0; b < skeleton.count(); ++b) {
    if (skeleton.bone(b).parent < 0 || reflection.twin(b) < b) continue;
    const Eigen::MatrixXd x = fit.values.middleCols(b * joint_features, joint_features);
    FeaturePairs moments = transposed_product(x, x) / static_cast<double>(x.rows());
    moments.diagonal().array() += 1e-12;
    const auto [values, vectors] = symmetric_eigen(moments);
    const Vector roots = values.cwiseSqrt();
    const FeaturePairs across = vectors.transpose();
    const FeaturePairs root = product(vectors * roots.asDiagonal(), across);
    const FeaturePairs inverse_root = product(vectors * roots.cwiseInverse().asDiagonal(), across);
    FeaturePairs gains = effect[b];
    if (reflection.exists() && reflection.twin(b) == b) {  // keys become even or odd
      FeaturePairs swap(joint_features, joint_features);
      for (int f = 0; f < joint_features; ++f) swap.col(f) = reflection.polynomial(b, JointFeatures::Unit(f));
      gains = 0.5 * (gains + product(product(swap, gains), swap.transpose()));
    }
    const auto main = symmetric_eigen(product(product(root, gains), root));
    for (int k = 0; k < joint_features; ++k) {
      JointFeatures c = product(inverse_root, main.vectors.col(k));
      c /= std::max(product(x, c).cwiseAbs().maxCoeff(), 1e-12);
      all.push_back({main.values[k], b, c});
    }
  }
  std::ranges::stable_sort(all, std::ranges::greater(), &Key::gain);
  for (const Key& key : all) {
    const Index twin = reflection.twin(key.joint);
    if (static_cast<int>(result.size()) + (twin == key.joint ? 1 : 2) > most) continue;
    result.push_back(key);
    if (twin != key.joint)
      result.push_back({key.gain, twin, reflection.polynomial(key.joint, key.coefficients)});
  }
  return result;
}

/// For each joint the quadratic form (9,9) of how much a polynomial of it reduces the squared residual.
std::vector<FeaturePairs> effects_of(const RigShape& rig, const CorrectiveFit& fit,
                                     const Progress& progress) {
  std::vector<std::vector<FeaturePairs>> parts(fit.regions.size());
  Index vertices = 0;
  for (const CorrectiveFit::Region& region : fit.regions)
    vertices += static_cast<Index>(region.vertices.size());
  parallel_jobs(static_cast<Index>(fit.regions.size()), [&](Index r) {
    if (progress.cancelled()) return;
    const CorrectiveFit::Region& region = fit.regions[r];
    const Index count = static_cast<Index>(region.joints.size()) * joint_features;
    const Eigen::MatrixXd slopes =
        fit.slopes(region, Eigen::MatrixXd::Identity(count, count), 1 + vertices / most_seen);
    const double share = static_cast<double>(3 * region.vertices.size()) / static_cast<double>(slopes.cols());
    for (Index row = 0; row < count; row += joint_features) {
      const Eigen::MatrixXd part = slopes.middleRows(row, joint_features);
      parts[r].push_back(share * product(part, part.transpose()));
    }
  });
  progress.check();
  std::vector<FeaturePairs> result(rig.skeleton.count(), FeaturePairs::Zero(joint_features, joint_features));
  for (std::size_t r = 0; r < parts.size(); ++r)
    for (std::size_t k = 0; k < parts[r].size(); ++k) result[fit.regions[r].joints[k]] += parts[r][k];
  return result;
}

}  // namespace

double Corrective::value(const Mat3& rotation) const {
  const double value = joint_features_of(rotation).dot(Eigen::Map<const JointFeatures>(coefficients.data()));
  return std::clamp(value, -1.0, 1.0);
}

std::vector<Corrective> skin_correctives(const TriangleMesh& given, const std::vector<Bone>& bones,
                                         const RowMatrix<float>& weights, const SkinOptions& options,
                                         const Progress& progress, const VertexWeights& painted) {
  options.validate();
  const ThreadScope threads(options.threads);
  const TriangleMesh mesh = facing_outwards(given);
  require(weights.rows() == mesh.vertices.rows() && weights.cols() == static_cast<Index>(bones.size()),
          "weights", std::to_string(weights.rows()) + " by " + std::to_string(weights.cols()),
          "a row for each vertex and a column for each bone are needed");
  const WeldedVertices welded(mesh);
  const RigShape rig = rig_shape(mesh, welded, painted, bones, options, progress);
  const Index n = mesh.vertices.rows();
  const std::vector<Index> nodes = rig.nearest_nodes({mesh.vertices, welded.normals, welded.pieces(mesh)});
  Vector trust(n);
  for (Index i = 0; i < n; ++i) trust[i] = rig.key_trust[nodes[welded.first[i]]];
  // The field of the whole moves fingers as one: keys would take them there.
  for (const FinePart& part : fine_parts(rig, mesh, welded))
    for (std::size_t k = 0; k < part.vertices.size(); ++k)
      trust[part.vertices[k]] *= 1.0 - part.shares[static_cast<Index>(k)];
  const CorrectiveFit fit(rig, mesh.vertices, trust, weights, options, progress.part(0.0, 0.8));
  progress.report(0.8, "Correctives");
  const std::vector<Key> keys =
      chosen_keys(rig.skeleton, fit, effects_of(rig, fit, progress), options.correctives);
  std::vector<Corrective> result(keys.size());
  for (std::size_t k = 0; k < keys.size(); ++k) {
    result[k].bone = rig.skeleton.original(keys[k].joint);
    Eigen::Map<JointFeatures>(result[k].coefficients.data()) = keys[k].coefficients;
    result[k].offsets = Points::Zero(n, 3);
  }
  // Offsets of all keys, by one regression for each region.
  parallel_jobs(static_cast<Index>(fit.regions.size()), [&](Index r) {
    const CorrectiveFit::Region& region = fit.regions[r];
    const auto near = static_cast<Index>(region.joints.size());
    std::vector<std::size_t> used;
    Eigen::MatrixXd polynomials(near * joint_features, 0);
    for (std::size_t k = 0; k < keys.size(); ++k) {
      const Index at = std::ranges::find(region.joints, keys[k].joint) - region.joints.begin();
      if (at == near) continue;
      used.push_back(k);
      polynomials.conservativeResize(Eigen::NoChange, polynomials.cols() + 1);
      polynomials.rightCols<1>().setZero();
      polynomials.rightCols<1>().segment<joint_features>(at * joint_features) = keys[k].coefficients;
    }
    if (used.empty() || progress.cancelled()) return;
    const Eigen::MatrixXd slopes = fit.slopes(region, polynomials);
    for (std::size_t v = 0; v < region.vertices.size(); ++v)
      for (std::size_t k = 0; k < used.size(); ++k)
        result[used[k]].offsets.row(region.vertices[v]) =
            slopes.block<1, 3>(static_cast<Index>(k), 3 * static_cast<Index>(v));
  });
  progress.check();
  return result;
}

}  // namespace arapfields
