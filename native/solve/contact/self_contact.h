// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "sampling/facing_runs.h"
#include "sampling/oriented_points.h"
#include "sampling/sample_windings.h"
#include "solve/radial/problem.h"

namespace arapfields {

/// A sample in self-contact with another one, whose tangent plane it must not pass.
struct FacingPair {
  Index first = 0;
  Index second = 0;
  Vec3 normal;         ///< of the second, outwards
  double gap = 0.0;    ///< signed, along the normal
  double least = 0.0;  ///< smallest allowed gap: the safety distance, or the gap at rest if that is smaller
};

/// Proximity search for self-contact. Pairs of samples with a short distance through the inside of the shape,
/// and samples that touch or overlap others at rest, are excluded. The pairs of the last search tell a sample
/// that has passed through another part from one that approaches it from behind.
class SelfContact {
 public:
  /// The state of the last search.
  struct Search {
    Points places;             ///< (n,3) positions
    std::vector<Index> faced;  ///< second sample of each one's pair; −1: none
  };
  /// Deformed normals (n,3), scaled by the area ratio, in these blocks of a RadialEvaluator; null: in all.
  using Normals = std::function<Points(const std::vector<Index>* blocks)>;
  /// For these rows of the problem's samples; the distance is in cube units. Throws InvalidInput without
  /// normals.
  SelfContact(const RadialProblem& problem, const std::vector<Index>& rows, double safety_distance);

  /// Pairs each sample with the nearest one that it faces within `near`, in cube units, at places (n,3), and
  /// replaces the last search. `normals` is called only if parts are near each other. `jumped`: the last
  /// search says nothing of how the shape came here, so that all negative gaps count.
  std::vector<FacingPair> find(PointsIn places, const Normals& normals, double near, bool jumped,
                               Search& last);
  /// Whether a part is inside another one, however deep, that it is outside of at rest, or is pressed flat
  /// (by winding numbers).
  bool overlaps(PointsIn places, PointsIn normals) const;
  /// Whether two samples are of parts that are kept apart.
  bool may_meet(Index i, Index j) const;
  /// Samples (n) within `near`, in cube units, of one of a part that they are kept apart from, and their
  /// neighbours.
  std::vector<bool> beside_others(PointsIn places, double near) const;
  /// The search that a solved shape starts with, in which only shallow negative gaps count.
  Search begin(PointsIn places, const Normals& normals);

 private:
  /// Which negative gaps (penetrations) count as pairs; at_rest is `all` without the test of winding numbers.
  enum class Penetrations { none, as_came, shallow, all, at_rest };
  std::vector<FacingPair> search(PointsIn places, const Normals& normals, double near,
                                 Penetrations penetrations, const Search& last = {});
  bool is_far(Index i, Index j, double distance) const;
  bool is_cut(Index i, Index j) const;
  bool came_through(Index i, Index j, const Vec3& normal, const Search& last) const;
  bool is_gap(double gap, Index i, Index j, const Vec3& normal, Penetrations penetrations,
              const Search& last) const;
  Index faced_by(Index i, const std::vector<Index>& runs, PointsIn places, const Points& normals, double near,
                 Penetrations penetrations, const Search& last) const;
  double winding(const SampleWindings& windings, Index i, double side, PointsIn places,
                 PointsIn normals) const;
  Vector windings_below(const SampleWindings& windings, PointsIn places, PointsIn normals) const;
  void measure_rest(PointsIn places);
  void find_cuts(PointsIn places);
  static Search search_of(PointsIn places, const std::vector<FacingPair>& pairs);

  RowMatrix<double> inside_;  // (n,6) rest positions and their interior embedding
  Points normals_;            // (n,3) at rest
  double safety_distance_ = 0.0;
  bool is_cut_ = false;  // whether parts intersect at rest
  std::optional<FacingRuns> runs_;
  std::vector<std::int32_t> meshes_;
  Points cuts_;                 // (n,3) nearest rest position of a sample inside another part; empty: none
  std::vector<Index> probes_;   // samples below which winding numbers are evaluated
  Vector windings_below_;       // winding numbers below the probes at rest
  Vector windings_above_;       // (n) winding numbers above the samples at rest
  double winding_scale_ = 1.0;  // scale for which winding numbers jump by 1 across the surface
  Vector widths_;               // (n) local width of the shape: twice its thickness
  Vector least_gaps_;           // (n) gaps at rest, at most safety_distance_; 0: excluded
  double most_offset_ = 0.0;    // largest tangential offset of a pair, in cube units
  bool penetrates_ = false;     // whether a gap was negative at the last search
};

/// Two triangles of a mesh that pass through each other.
struct SelfCrossing {
  Index first;  ///< the contact samples nearest to the crossing on both of them
  Index second;
  Vec3 place;  ///< of the crossing now
};

/// Where the triangles of the samples' mesh pass through each other: a test that does not depend on how
/// SelfContact pairs samples. Counted are pairs of triangles of parts that it keeps apart which do not cross
/// at rest.
class SelfCrossings {
 public:
  /// Positions (n,3) of rest points (n,3), both in cube coordinates.
  using Field = std::function<Points(const Points&)>;
  /// For these contact samples of the problem, with the mean distance of neighbouring ones.
  SelfCrossings(const RadialProblem& problem, const std::vector<Index>& rows, double spacing);
  /// Whether the samples know their mesh.
  bool knows_mesh() const { return problem_.samples.mesh != nullptr; }
  /// One crossing for each pair of triangles, with the contact samples at `places` (n,3). Only triangles
  /// where parts are near each other are looked at. Throws Cancelled.
  std::vector<SelfCrossing> find(const SelfContact& contact, PointsIn places, const Field& field,
                                 const Progress& progress = {});

 private:
  struct Mesh {
    Points rest;                     // (n,3) cube coordinates
    std::vector<std::int32_t> same;  // the first vertex at each one's position
    OrientedPoints samples;
    std::vector<Index> owners;   // the contact sample nearest to the middle of each triangle
    std::vector<bool> reaching;  // whether a corner of it is far from that sample
  };
  const Mesh& mesh();
  Vec3 rest_at(Index triangle, const Vec3& at) const;
  std::vector<Index> nearest(const Points& places, const std::vector<Index>& triangles) const;

  const RadialProblem& problem_;
  Points samples_;  // (n,3) at rest
  Points normals_;
  double spacing_;
  std::optional<Mesh> mesh_;  // made once parts come near each other
};

}  // namespace arapfields
