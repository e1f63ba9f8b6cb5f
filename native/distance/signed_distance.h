// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "core/task.h"
#include "core/types.h"

namespace arapfields {

/// Closest points of a soup to some queries.
struct ClosestPoints {
  Points points;                        ///< (p,3) on the soup
  std::vector<std::int32_t> triangles;  ///< where they lie; of several equally near triangles the first
  Vector distances;                     ///< (p) ≥ 0
};

/// Distances to a triangle soup. Built once; queries may come from any number of threads.
/// Magnitudes are exact to rounding (float64). A point is inside, and its distance negative, where the
/// winding number exceeds 1/2, as in Jacobson et al. 2013, "Robust Inside-Outside Segmentation using
/// Generalized Winding Numbers"; for that the soup may be open, self-intersecting and partly degenerate.
class ARAPFIELDS_EXPORT SignedDistance {
 public:
  /// Builds the hierarchy; throws InvalidInput as validate(vertices, triangles) does. `progress` only
  /// cancels.
  SignedDistance(PointsIn vertices, TrianglesIn triangles, const Progress& progress = {});
  ~SignedDistance();
  SignedDistance(SignedDistance&&) noexcept;

  /// All calls take points (p,3) in the mesh's coordinates, throw InvalidInput naming `points` for
  /// coordinates that are not finite (or beyond 1e90 times the mesh's size), and use all threads in force.
  /// No result depends on the thread count or on the other points.
  void evaluate(PointsIn points, Eigen::Ref<Vector> distances, const Progress& progress = {}) const;
  /// The same, and the closest points, found once.
  ClosestPoints evaluate_closest(PointsIn points, Eigen::Ref<Vector> distances,
                                 const Progress& progress = {}) const;
  void unsigned_distance(PointsIn points, Eigen::Ref<Vector> distances, const Progress& progress = {}) const;
  ClosestPoints closest(PointsIn points, const Progress& progress = {}) const;
  /// How often the soup winds around each point: 1 inside and 0 outside of a closed surface, fractions near
  /// the gaps of an open one. Off by less than 1e-3 for a single sheet.
  void winding_number(PointsIn points, Eigen::Ref<Vector> numbers, const Progress& progress = {}) const;
  /// For each segment from a point of `from` (p,3) to that of `to` (p,3) the least t ∈ [0,1] at which from +
  /// t (to − from) meets the soup; infinity where it meets nothing. `labels`, if given, has one number for
  /// each triangle, and a segment then meets the triangles of its own label (p) alone.
  Vector first_crossings(PointsIn from, PointsIn to, const std::vector<std::int32_t>& labels = {},
                         const std::vector<std::int32_t>& own_labels = {},
                         const Progress& progress = {}) const;
  /// Whether the triangles' oriented edges cancel (vertices at equal positions taken as one): then the
  /// winding number is an integer, constant wherever one can go without touching a triangle.
  bool is_closed() const;

 private:
  void evaluate(PointsIn points, Eigen::Ref<Vector> distances, ClosestPoints* closest,
                const Progress& progress) const;
  struct Parts;
  std::unique_ptr<const Parts> parts_;
};

/// The same for one use: (p) distances of points (p,3). `threads` 0 uses all that are in force.
ARAPFIELDS_EXPORT Vector signed_distance(PointsIn vertices, TrianglesIn triangles, PointsIn points,
                                         int threads = 0, const Progress& progress = {});

}  // namespace arapfields
