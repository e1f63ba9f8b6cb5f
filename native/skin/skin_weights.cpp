// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/skin_weights.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "sampling/oriented_points.h"
#include "skin/example_poses.h"
#include "skin/vertex_blend.h"
#include "skin/weight_fit.h"

namespace arapfields {
namespace {

constexpr std::uint64_t stream = 34;
/// Poses of a round. Rounds go on until new poses are off by at most so many times what known ones are.
constexpr int round_poses = 8;
constexpr double good_ratio = 1.03;
/// How often each joint turns at least.
constexpr double least_activity = 0.5;
/// In sizes of the shape: how closely bones and vertices are mirrored, and closed pieces that stay rigid.
constexpr double symmetric_bones = 1e-3, symmetric_vertices = 1e-4, rigid_size = 0.12;
/// The share of a piece's weights from which one bone has them all.
constexpr float one_bone = 0.8f;

/// The joints' shares in the errors of a round, as probabilities to turn.
Vector activity_of(const RigShape& rig, const Vector& errors) {
  Vector result = Vector::Zero(rig.skeleton.count());
  for (Index i = 0; i < rig.size(); ++i) {
    Index nearest = 0;
    rig.bone_distances.row(i).minCoeff(&nearest);
    result[nearest] += errors[i];
    if (rig.skeleton.bone(nearest).parent >= 0) result[rig.skeleton.bone(nearest).parent] += errors[i];
  }
  return (result / std::max(result.mean(), 1e-300)).cwiseMin(1.0).cwiseMax(least_activity);
}

RowMatrix<float> node_weights(const RigShape& rig, const SkinOptions& options, const Progress& progress) {
  ExamplePoses poses(rig, rig.nodes, options, progress.part(0.0, 0.1));
  WeightFit fit(rig);
  Random random(options.seed, stream);
  Vector activity = Vector::Ones(rig.skeleton.count());
  for (int done = 0; done < options.poses; done += round_poses) {
    const double share = static_cast<double>(done) / options.poses;
    Vector errors = Vector::Zero(rig.size());
    std::vector<ExamplePose> round;
    for (int k = 0; k < std::min(round_poses, options.poses - done); ++k) {
      progress.report(0.1 + 0.8 * share, "Posing");
      round.push_back(poses.draw(random, activity, progress));
      errors += fit.squared_errors(round.back()) / round_poses;
    }
    const double known = fit.mean_squared_error();
    for (const ExamplePose& pose : round) fit.add(pose);
    const bool enough = done >= 3 * round_poses && errors.mean() < good_ratio * good_ratio * known;
    fit.solve(options.influences, options.smoothness, progress.part(0.1 + 0.8 * share, 0.1 + 0.8 * share));
    activity = activity_of(rig, errors);
    if (enough) break;
  }
  return fit.weights();
}

/// The largest `influences` of a row ≥ 0 that are larger than all others, of sum one.
void keep_largest(Eigen::Ref<RowMatrix<float>> row, int influences) {
  row = row.cwiseMax(0.0f);
  std::vector<float> sorted(row.data(), row.data() + row.size());
  if (static_cast<int>(sorted.size()) > influences) {
    std::ranges::nth_element(sorted, sorted.begin() + influences, std::greater<>());
    const float next = sorted[influences] * (1.0f + 1e-4f);  // mirrored bones' weights stay or go together
    const float most = row.maxCoeff();
    if (next < most) row = (row.array() > next).select(row, 0.0f);
  }
  row = (row.array() < 1e-3f * row.maxCoeff()).select(0.0f, row);
  row /= row.sum();
}

/// Rows of vertices that are mirrored, where the skeleton is symmetric across a plane of the axes, become
/// mirrored.
void make_symmetric(const RigShape& rig, PointsIn vertices, RowMatrix<float>& weights) {
  const Skeleton& skeleton = rig.skeleton;
  for (int axis = 0; axis < 3; ++axis) {
    double offset = 0.0;
    for (Index b = 0; b < skeleton.count(); ++b)
      offset += skeleton.bone(b).head[axis] / static_cast<double>(skeleton.count());
    const std::vector<Index> mirrored = skeleton.mirrored(axis, offset, symmetric_bones * rig.extent);
    bool any = false;
    for (std::size_t b = 0; b < mirrored.size(); ++b) any |= mirrored[b] != static_cast<Index>(b);
    if (!any) continue;
    Points reflected = vertices;
    reflected.col(axis) = (2.0 * offset - vertices.col(axis).array()).matrix();
    const Points none = Points::Zero(vertices.rows(), 3);
    const std::vector<Index> twins = OrientedPoints(vertices, none).nearest(reflected, none, 0.0);
    RowMatrix<float> result = weights;
    for (Index i = 0; i < weights.rows(); ++i)
      if ((vertices.row(twins[i]) - reflected.row(i)).norm() < symmetric_vertices * rig.extent)
        for (Index b = 0; b < weights.cols(); ++b)
          result(i, b) = 0.5f * (weights(i, b) + weights(twins[i], mirrored[b]));
    weights = std::move(result);
    return;
  }
}

/// Each small closed piece gets one motion: of one bone, where that moves nearly all of it.
void make_rigid(const RigShape& rig, const TriangleMesh& mesh, const WeldedVertices& welded,
                RowMatrix<float>& weights) {
  for (const std::vector<Index>& piece : welded.closed_pieces(mesh, rigid_size * rig.extent)) {
    RowMatrix<float> mean = RowMatrix<float>::Zero(1, weights.cols());
    for (const Index v : piece) mean += weights.row(v).cwiseMax(0.0f);
    Index most = 0;
    if (mean.row(0).maxCoeff(&most) > one_bone * mean.sum()) {
      mean.setZero();
      mean(0, most) = 1.0f;
    }
    for (const Index v : piece) weights.row(v) = mean.row(0);
  }
}

/// The columns of all bones, from those of the deforming ones.
RowMatrix<float> finished(const RigShape& rig, RowMatrix<float> fitted, Index bones, int influences) {
  RowMatrix<float> result = RowMatrix<float>::Zero(fitted.rows(), bones);
  parallel_for(0, fitted.rows(), 256, [&](Index first, Index last) {
    for (Index i = first; i < last; ++i) {
      keep_largest(fitted.row(i), influences);
      for (Index b = 0; b < fitted.cols(); ++b) result(i, rig.skeleton.original(b)) = fitted(i, b);
    }
  });
  return result;
}

}  // namespace

RowMatrix<float> skin_weights(const SurfaceSamples& samples, const std::vector<Bone>& bones,
                              const SkinOptions& options, const Progress& progress) {
  options.validate();
  const ThreadScope threads(options.threads);
  const RigShape rig(samples, bones, progress);
  const RowMatrix<float> nodes = node_weights(rig, options, progress);
  const VertexBlend blend(rig, samples.frame.to_mesh(samples.points), samples.normals);
  return finished(rig, blend(nodes), static_cast<Index>(bones.size()), options.influences);
}

RowMatrix<float> skin_weights(const TriangleMesh& mesh, const std::vector<Bone>& bones,
                              const SkinOptions& options, const Progress& progress,
                              const VertexWeights& painted) {
  options.validate();
  const ThreadScope threads(options.threads);
  const RigShape rig(sample_mesh(mesh.vertices, mesh.triangles, options.samples, options.seed, painted),
                     bones, progress);
  const WeldedVertices welded(mesh);
  const RowMatrix<float> nodes = node_weights(rig, options, progress);
  progress.report(0.95, "Weights");
  RowMatrix<float> fitted = VertexBlend(rig, mesh.vertices, welded.normals)(nodes);
  make_symmetric(rig, mesh.vertices, fitted);
  make_rigid(rig, mesh, welded, fitted);
  for (Index i = 0; i < fitted.rows(); ++i) fitted.row(i) = fitted.row(welded.first[i]).eval();
  return finished(rig, std::move(fitted), static_cast<Index>(bones.size()), options.influences);
}

}  // namespace arapfields
