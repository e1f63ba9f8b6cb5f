// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/skin_weights.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/parallel.h"
#include "distance/welded_vertices.h"
#include "mesh/outward_triangles.h"
#include "skin/bone_choice.h"
#include "skin/example_poses.h"
#include "skin/fine_parts.h"
#include "skin/weight_fit.h"

namespace arapfields {
namespace {

constexpr std::uint64_t example_stream = 34;
/// Poses of a round; joints with larger errors in the round before rotate more often.
constexpr int round_poses = 8;
/// Least probability with which a joint rotates in a pose.
constexpr double least_activity = 0.8;
/// Largest diagonal of closed pieces that stay rigid, in sizes of the shape: eyes may be large.
constexpr double rigid_size = 0.2;
/// Fraction of a piece's weights above which one bone gets all of them.
constexpr float one_bone = 0.8f;

/// Probabilities of the joints to rotate, from their fractions of the errors of a round.
Vector activity_of(const RigShape& rig, const Vector& errors) {
  Vector result = Vector::Zero(rig.skeleton.count());
  for (Index i = 0; i < rig.size(); ++i) {
    const Index nearest = rig.owners[i];
    result[nearest] += errors[i];
    if (rig.skeleton.bone(nearest).parent >= 0) result[rig.skeleton.bone(nearest).parent] += errors[i];
  }
  return (result / std::max(result.mean(), 1e-300)).cwiseMin(1.0).cwiseMax(least_activity);
}

/// Weights at a rig's nodes, and the poses that they were fitted to.
struct Fitted {
  RowMatrix<float> nodes;
  RowMatrix<float> support;
  std::vector<ExamplePose> poses;
};

/// Fits the nodes' weights to example poses; the poses' shapes have the nodes and then these points. `hold`:
/// what a bone holds moves rigidly with it, although the field may not follow that closely.
Fitted fitted_nodes(const RigShape& rig, PointsIn points, const std::vector<Index>& near, bool hold,
                    const SkinOptions& options, const Progress& progress) {
  Points moved(rig.size() + points.rows(), 3);
  moved << rig.nodes.points, points;
  std::vector<Index> nearest(rig.size());
  std::iota(nearest.begin(), nearest.end(), Index{0});
  nearest.insert(nearest.end(), near.begin(), near.end());
  ExamplePoses poses(rig, moved, options, progress.part(0.0, 0.1));
  if (hold) poses.hold(nearest);
  WeightFit fit(rig);
  Fitted result;
  Random random(options.seed, example_stream);
  Vector activity = Vector::Ones(rig.skeleton.count());
  for (int done = 0; done < options.poses; done += round_poses) {
    const double share = static_cast<double>(done) / options.poses;
    Vector errors = Vector::Zero(rig.size());
    const int count = std::min(round_poses, options.poses - done);
    for (int k = 0; k < count; ++k) {
      progress.report(0.1 + 0.8 * share, "Posing");
      result.poses.push_back(poses.draw(random, activity, progress));
      errors += fit.squared_errors(result.poses.back()) / count;
    }
    for (int k = 0; k < count; ++k) fit.add(result.poses[result.poses.size() - count + k]);
    fit.solve(options.smoothness, progress.part(0.1 + 0.8 * share, 0.1 + 0.8 * share));
    activity = activity_of(rig, errors);
  }
  result.nodes = fit.weights();
  result.support = fit.support(options.smoothness, options.influences);
  return result;
}

/// Weights of points of the shape.
RowMatrix<float> fitted_points(const RigShape& rig, const PiecePoints& given, bool hold,
                               const SkinOptions& options, const Progress& progress) {
  const std::vector<Index> near = rig.nearest_nodes(given);
  const Fitted fitted = fitted_nodes(rig, given.points, near, hold, options, progress);
  progress.report(0.9, "Weights");
  const VertexBlend blend(rig, given, near);
  SkinPoints points{given.points,
                    near,
                    blend(fitted.nodes),
                    blend(fitted.support),
                    blend(rig.bone_distances),
                    RigTwins(rig, given.points)};
  for (RowMatrix<float>* values : {&points.weights, &points.support, &points.distances})
    points.twins.average_alike(*values);
  const LimbSides limbs(rig, given, near, points.distances);
  progress.report(0.93, "Weights");
  RowMatrix<float> result = point_weights(rig, points, limbs, fitted.poses, options);
  points.twins.average_twins(result);
  return result;
}

/// A fine part has fewer samples and poses than the whole, by these factors, and at least so many, if the
/// whole has them.
constexpr int fewer_samples = 3, fewer_poses = 4, least_part_poses = 8;
constexpr int least_part_samples = 3000;
/// Share of the fine parts in the work.
constexpr double parts_work = 0.3;

Vector entries_or_none(const Vector& values, const std::vector<Index>& rows) {
  return values.size() == 0 ? values : Vector(values(rows));
}

/// Blends the own weights of a part into those of the whole.
void refine(const FinePart& part, const VertexWeights& painted, const SkinOptions& options,
            const Progress& progress, RowMatrix<float>& weights) {
  SkinOptions own = options;
  own.samples = std::max(own.samples / fewer_samples, std::min(own.samples, least_part_samples));
  own.poses = std::max(own.poses / fewer_poses, std::min(own.poses, least_part_poses));
  const WeldedVertices welded(part.mesh);
  const VertexWeights stiffness{entries_or_none(painted.weights, part.vertices),
                                entries_or_none(painted.bend_weights, part.vertices)};
  const RigShape rig = rig_shape(part.mesh, welded, stiffness, part.bones, own, progress);
  const RowMatrix<float> found =
      fitted_points(rig, {part.mesh.vertices, welded.normals, welded.pieces(part.mesh)}, true, own, progress);
  for (std::size_t k = 0; k < part.vertices.size(); ++k) {
    const auto share = static_cast<float>(part.shares[static_cast<Index>(k)]);
    auto row = weights.row(part.vertices[k]);
    row *= 1.0f - share;
    for (Index b = 0; b < found.cols(); ++b)
      row[part.columns[rig.skeleton.original(b)]] += share * found(static_cast<Index>(k), b);
  }
}

/// Keeps the largest `influences` entries of a row (fewer where entries are tied), and normalises it.
void keep_largest(Eigen::Ref<RowMatrix<float>> row, int influences) {
  row = row.cwiseMax(0.0f);
  std::vector<float> sorted(row.data(), row.data() + row.size());
  if (static_cast<int>(sorted.size()) > influences) {
    std::ranges::nth_element(sorted, sorted.begin() + influences, std::greater<>());
    const float next = sorted[influences] * (1.0f + 1e-4f);  // equal weights of mirrored bones are tied
    const float most = row.maxCoeff();
    if (next < most) row = (row.array() > next).select(row, 0.0f);
  }
  row = (row.array() < 1e-3f * row.maxCoeff()).select(0.0f, row);
  row /= row.sum();
}

/// Gives each small closed piece uniform weights: those of one bone if it has nearly all of them.
void make_rigid(const RigShape& rig, const TriangleMesh& mesh, const WeldedVertices& welded,
                RowMatrix<float>& weights) {
  const std::vector<Index> pieces = welded.pieces(mesh);
  for (const std::vector<Index>& piece : welded.closed_pieces(mesh, rigid_size * rig.extent)) {
    if (rig.bends(pieces[piece.front()])) continue;
    RowMatrix<float> mean = RowMatrix<float>::Zero(1, weights.cols());
    for (const Index v : piece) mean += weights.row(v).cwiseMax(0.0f);
    Index most = 0;
    if (mean.row(0).maxCoeff(&most) > (rig.cuts_itself() ? 0.0f : one_bone * mean.sum())) {
      mean.setZero();
      mean(0, most) = 1.0f;
    }
    for (const Index v : piece) weights.row(v) = mean.row(0);
  }
}

/// Expands the columns of the deforming bones to those of all bones.
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
  return finished(rig, fitted_points(rig, rig.surface, rig.cuts_itself(), options, progress),
                  static_cast<Index>(bones.size()), options.influences);
}

RowMatrix<float> skin_weights(const TriangleMesh& given, const std::vector<Bone>& bones,
                              const SkinOptions& options, const Progress& progress,
                              const VertexWeights& painted) {
  options.validate();
  const ThreadScope threads(options.threads);
  const TriangleMesh mesh = facing_outwards(given);
  const WeldedVertices welded(mesh);
  const RigShape rig = rig_shape(mesh, welded, painted, bones, options, progress);
  const std::vector<FinePart> parts = fine_parts(rig, mesh, welded);
  const auto work = [&](std::size_t done) {
    return 1.0 - parts_work * static_cast<double>(parts.size() - done) /
                     static_cast<double>(std::max<std::size_t>(parts.size(), 1));
  };
  RowMatrix<float> fitted =
      fitted_points(rig, {mesh.vertices, welded.normals, welded.pieces(mesh)}, rig.cuts_itself(), options,
                    progress.part(0.0, parts.empty() ? 1.0 : work(0)));
  for (std::size_t k = 0; k < parts.size(); ++k)
    refine(parts[k], painted, options, progress.part(work(k), work(k + 1)), fitted);
  if (!parts.empty()) RigTwins(rig, mesh.vertices).average_twins(fitted);
  make_rigid(rig, mesh, welded, fitted);
  for (Index i = 0; i < fitted.rows(); ++i) fitted.row(i) = fitted.row(welded.first[i]).eval();
  return finished(rig, std::move(fitted), static_cast<Index>(bones.size()), options.influences);
}

}  // namespace arapfields
