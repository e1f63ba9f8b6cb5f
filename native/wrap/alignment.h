// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "wrap/target.h"
#include "wrap/wrap.h"

namespace arapfields {

/// The surface to align: points (n,3) in its cube with normals (n,3), and landmarks on it.
struct WrapSource {
  Points points, normals;
  Points landmarks;         ///< (k,3)
  Points landmark_targets;  ///< (k,3) the corresponding points of the target
  Frame frame;

  /// The same surface with these of its landmarks.
  WrapSource with_landmarks(const std::vector<Index>& rows) const;
  /// Distances (k) of the landmarks under this placement to their targets.
  Vector distances(const Similarity& placement) const;
};

/// The similarity that maps points to others in weighted least squares; `scale` is fixed unless 0.
Similarity fitted_similarity(PointsIn from, PointsIn to, const Vector& weights, double scale);

/// The radius of gyration of points: their root mean square distance from the mean.
double gyration(PointsIn points);
/// "landmarks[i]".
std::string landmark_name(Index i);
/// "12.3 %".
std::string percent_text(double share);

/// Throws InvalidInput that names a landmark which is not finite or far off its surface.
void check_landmarks(const WrapSource& source, const WrapTarget& target);
/// Throws InvalidInput that names two landmarks, of these ascending rows, that coincide on one surface and
/// are far apart on the other.
void check_contradictions(const WrapSource& source, const WrapTarget& target, const std::vector<Index>& rows);

/// The initial similarity of a wrap, from the cube to the target's coordinates. With three landmarks or more
/// it is their least-squares fit; else the result of iterative closest points (Besl, McKay 1992), started
/// without rotation, or with one that aligns the principal axes if that is far better. `normal_weight` is the
/// weight of differences of normals relative to distances. Appends to `warnings`.
Similarity wrap_alignment(const WrapSource& source, const WrapTarget& target, AlignmentKind kind,
                          double normal_weight, std::vector<std::string>& warnings, const Progress& progress);

}  // namespace arapfields
