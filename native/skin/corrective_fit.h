// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/task.h"
#include "options/skin.h"
#include "skin/rig_shape.h"
#include "skin/rig_twins.h"

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

  /// Vertices (n,3) near these nodes, weights (n, bones); throws Cancelled.
  CorrectiveFit(const RigShape& rig, PointsIn vertices, const std::vector<Index>& nodes,
                const RowMatrix<float>& weights, const SkinOptions& options, const Progress& progress);

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

}  // namespace arapfields
