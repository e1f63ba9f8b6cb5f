// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/frame.h"
#include "core/jets.h"
#include "core/random.h"

namespace arapfields {

/// A part of the surface that follows a rigid motion, or an affine one where it may scale.
struct ARAPFIELDS_EXPORT Handle {
  enum class Kind {
    cuboid,  ///< the samples inside the box that `rest` makes of [-1,1]³
    point,   ///< one material point, at or near the surface; no sample needed
    region   ///< the samples listed
  };
  Kind kind = Kind::cuboid;
  Mat4 rest = Mat4::Identity();    ///< cuboid, region: the motion is target·rest⁻¹
  Mat4 target = Mat4::Identity();  ///< rigidly moved rest, or any box where the handle may scale
  Vec3 rest_point = Vec3::Zero();  ///< point
  Vec3 target_point = Vec3::Zero();
  std::vector<Index> samples;  ///< region: sample indices
  double weight = 1.0;         ///< factor of this handle's part of the loss
  /// Distance through the interior of the shape within which it moves the surface, mesh units; 0: everything.
  double reach = 0.0;
  bool allow_scale = false;  ///< cuboid, region: the target may be scaled or sheared

  /// The handle of mesh coordinates in the frame's cube.
  Handle in_cube(const Frame& frame) const;
  /// target·rest⁻¹ made exactly rigid (of a point: the translation). Throws InvalidInput that names handle
  /// `index` for non-finite matrices, a rest pose without volume, and motions that scale, shear or mirror by
  /// more than 1e-3. Where the handle may scale, it is target·rest⁻¹ itself; a target that is flat or mirrors
  /// the rest pose, which no space can follow without being torn, is refused then.
  Mat4 motion(Index index = 0) const;
};

/// Pairs x → C x of one evaluation with their weights: loss = Σ_p weights_p ‖f(sources_p) − targets_p‖².
template <class Scalar>
struct HandleBatch {
  PointsOf<Scalar> sources, targets;
  Eigen::VectorX<Scalar> weights;
};

/// Handles with their sample members, sources and targets computed once. All in cube coordinates.
/// The loss is the mean over the handles of weight × mean over the handle's pairs of ‖f(x) − C x‖².
class ARAPFIELDS_EXPORT BoundHandles {
 public:
  /// In sizes of the shape: the largest extent of the samples' box.
  static constexpr double beside = 0.1;
  static constexpr double farthest = 0.5;

  BoundHandles() = default;
  /// Throws InvalidInput that names a handle which is invalid, holds no sample, or is a point farther than
  /// `farthest` sizes from the samples. A point outside of the samples' box and farther than `beside` from
  /// them is replaced by the nearest sample.
  BoundHandles(std::vector<Handle> handles, PointsIn samples);

  Index count() const { return static_cast<Index>(handles_.size()); }
  const Handle& handle(Index i) const { return handles_[i]; }
  /// Pairs of handle i are rows begin(i) … begin(i+1)−1.
  Index begin(Index i) const { return begin_[i]; }
  const Points& sources() const { return sources_; }
  const Points& targets() const { return targets_; }
  /// Index of each pair's sample, −1 for point handles.
  const std::vector<Index>& members() const { return members_; }
  const Mat4& motion(Index i) const { return motions_[i]; }
  /// Distance, in sizes of the shape, over which a point handle was moved onto the nearest sample; 0: not.
  double brought(Index i) const { return brought_[static_cast<std::size_t>(i)]; }

  /// New targets for the same regions: each handle's target (or target_point) is taken from `moved`.
  void retarget(const std::vector<Handle>& moved);
  /// All pairs, or at most `per_handle` random ones of each handle (0: all).
  template <class Scalar>
  ARAPFIELDS_EXPORT HandleBatch<Scalar> batch(Index per_handle, Random& random) const;
  template <class Scalar>
  ARAPFIELDS_EXPORT HandleBatch<Scalar> all() const;

 private:
  void move(Index i);
  Vec3 place_of(Index point, PointsIn samples);

  std::vector<Handle> handles_;
  std::vector<Mat4> motions_;
  std::vector<Index> begin_{0};
  std::vector<Index> members_;
  Points sources_, targets_;
  std::vector<double> brought_;
};

/// Value of the batch's loss for jets at batch.sources; adds weight times its cotangents on the value column
/// (data may be null).
template <class Scalar>
ARAPFIELDS_EXPORT double handle_energy(JetView<const Scalar> jets, const HandleBatch<Scalar>& batch,
                                       double weight, JetView<Scalar> cotangents);

struct HandleError {
  double mean = 0.0;  ///< mean over handles of the mean distance ‖f(x) − C x‖
  double max = 0.0;   ///< largest distance over all pairs
};

/// For the field's values (rows) at handles.sources().
ARAPFIELDS_EXPORT HandleError handle_error(const BoundHandles& handles, PointsIn values);

}  // namespace arapfields
