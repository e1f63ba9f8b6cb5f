// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <vector>

#include "core/task.h"
#include "mesh/sample_mesh.h"
#include "mesh/triangle_mesh.h"
#include "options/skin.h"
#include "skin/skeleton.h"

namespace arapfields {

/// A corrective shape key that brings the skin closer to the field, driven by one joint. Its value is a
/// polynomial of the joint's rotation in the bone's axes, the unit quaternion (w, x, y, z): Σ coefficients ·
/// (wx, wy, wz, xx, yy, zz, xy, xz, yz), clamped to [−1, 1]. It is equal for q and −q, and 0 at rest.
struct ARAPFIELDS_EXPORT Corrective {
  Index bone;                          ///< among all bones
  std::array<double, 9> coefficients;  ///< scaled so that 1 is the largest absolute value over the poses
  Points offsets;                      ///< (n,3) of the vertices at rest

  double value(const Mat3& rotation) const;
};

/// At most options.correctives shape keys for weights (n, bones), in descending order of how much they reduce
/// the squared residual between skin and field. On a symmetric rig twin bones have mirrored keys, and the
/// other keys are even or odd. Throws InvalidInput as skin_weights does; Cancelled.
ARAPFIELDS_EXPORT std::vector<Corrective> skin_correctives(
    const TriangleMesh& mesh, const std::vector<Bone>& bones, const RowMatrix<float>& weights,
    const SkinOptions& options, const Progress& progress = {}, const VertexWeights& painted = {});

}  // namespace arapfields
