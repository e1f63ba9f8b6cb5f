// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>

#include "core/types.h"
#include "distance/hierarchy_layout.h"

namespace arapfields {

/// Integrals over some triangles with unit normals n, y = x − center:
/// N = ∫ n, Q = ∫ y nᵀ, T[k] = ∫ y yᵀ n_k (Barill et al. 2018, appendix A).
struct Multipole {
  Vec3 center = Vec3::Zero();
  double area = 0.0;
  double radius = 0.0;  ///< of a sphere about the center that holds the triangles
  Vec3 dipole = Vec3::Zero();
  Mat3 quadrupole = Mat3::Zero();
  std::array<Mat3, 3> octupole = {Mat3::Zero(), Mat3::Zero(), Mat3::Zero()};
};

/// The moments of triangles with corners corners[3 i + 0..2]; the center is their area-weighted centroid.
Multipole multipole_of(const Vec3* corners, int triangle_count);

/// The moments of the union of all parts.
Multipole multipole_of(const Multipole* parts, int count);

/// Writes the moments into one lane.
void store(const Multipole& multipole, NodeMoments& moments, int lane);
/// Makes a lane contribute nothing.
void store_nothing(NodeMoments& moments, int lane);

}  // namespace arapfields
