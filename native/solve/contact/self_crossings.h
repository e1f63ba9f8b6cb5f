// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "sampling/oriented_points.h"
#include "solve/contact/self_contact.h"

namespace arapfields {

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
