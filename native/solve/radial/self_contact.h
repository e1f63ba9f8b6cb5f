// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "sampling/facing_runs.h"
#include "sampling/sample_windings.h"
#include "solve/radial/problem.h"

namespace arapfields {

/// A place of a surface that faces another one, far from it inside the shape.
struct FacingPair {
  Index first = 0;
  Index second = 0;
  Vec3 normal;         ///< of the second, outwards
  double gap = 0.0;    ///< along the normal
  double least = 0.0;  ///< gap to be kept: as at rest where that is less
};

/// Where a surface meets itself. Samples that are near each other inside the shape, and those that touch or
/// overlap others at rest, are left alone. Which side a sample came from tells what is beyond.
class SelfContact {
 public:
  /// What tells which side a place came from.
  struct Ways {
    Points seen;               ///< places at the last search
    std::vector<Index> faced;  ///< what each faced then; −1: nothing
  };
  /// (n,3) as long as the surface there is stretched, in these blocks of a RadialEvaluator; null: in all.
  using Normals = std::function<Points(const std::vector<Index>* blocks)>;
  /// For these rows of the problem's samples. Throws InvalidInput without normals.
  SelfContact(const RadialProblem& problem, const std::vector<Index>& rows, double kept);

  /// For each sample the nearest one that it faces, within `near`, of cube units, at places (n,3); `normals`
  /// are asked for where parts are near each other. `jumped`: the way here is not known.
  std::vector<FacingPair> find(PointsIn places, const Normals& normals, double near, bool jumped = false);
  /// Whether a part is inside another one, however deep, where it is not at rest.
  bool overlaps(PointsIn places, PointsIn normals) const;
  const Ways& ways() const { return ways_; }
  void set_ways(Ways ways) { ways_ = std::move(ways); }
  /// The ways start here.
  void begin(PointsIn places, const Normals& normals);

 private:
  /// Which gaps below zero are pairs.
  enum class Beyond { none, as_came, shallow, all, at_rest };
  std::vector<FacingPair> search(PointsIn places, const Normals& normals, double near, Beyond beyond);
  bool is_far(Index i, Index j, double distance) const;
  bool is_cut(Index i, Index j) const;
  bool may_meet(Index i, Index j) const;
  bool came_through(Index i, Index j, const Vec3& normal) const;
  bool is_gap(double gap, Index i, Index j, const Vec3& normal, Beyond beyond) const;
  Index faced_by(Index i, const std::vector<Index>& runs, PointsIn places, const Points& normals, double near,
                 Beyond beyond) const;
  double winding(const SampleWindings& windings, Index i, double side, PointsIn places,
                 PointsIn normals) const;
  Vector below(const SampleWindings& windings, PointsIn places, PointsIn normals) const;
  void measure_rest(PointsIn places);
  void find_cuts(PointsIn places);
  void remember(PointsIn places, const std::vector<FacingPair>& pairs);

  RowMatrix<double> inside_;  // (n,6) rest places and their embedding
  Points normals_;            // (n,3) at rest
  double kept_ = 0.0;
  bool is_cut_ = false;  // whether parts cut each other at rest
  std::optional<FacingRuns> runs_;
  std::vector<std::int32_t> meshes_;
  Points cuts_;                // (n,3) nearest places at rest that are inside another part; empty: none
  std::vector<Index> probes_;  // rows below which windings are taken
  Vector below_;               // windings there at rest
  Vector above_;               // (n) windings above the samples at rest
  double share_ = 1.0;         // of a sample in them
  Vector widths_;              // (n) of the shape there
  Vector least_;               // (n) gaps at rest, at most what is kept; 0: left alone
  double aside_ = 0.0;         // what is farther aside does not face
  Ways ways_;
  bool is_beyond_ = false;  // whether a sample was beyond another at the last search
};

}  // namespace arapfields
