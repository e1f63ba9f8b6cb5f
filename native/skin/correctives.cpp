// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/correctives.h"

#include <algorithm>

#include "core/decompositions.h"
#include "core/errors.h"
#include "core/parallel.h"
#include "distance/welded_vertices.h"
#include "mesh/outward_triangles.h"
#include "skin/corrective_fit.h"

namespace arapfields {
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
  std::vector<Index> nodes = rig.nearest_nodes({mesh.vertices, welded.normals, welded.pieces(mesh)});
  for (Index i = 0; i < n; ++i) nodes[i] = nodes[welded.first[i]];
  const CorrectiveFit fit(rig, mesh.vertices, nodes, weights, options, progress.part(0.0, 0.8));
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
