// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "skin/rig_shape.h"

namespace arapfields {

/// A part of a rig whose bones lie nearer to each other than the nodes of the whole, such as a hand with its
/// fingers. Its weights are found on its own surface, with nodes as much nearer to each other as it is
/// smaller.
struct FinePart {
  std::vector<Bone> bones;      ///< a skeleton: what bends in it, and the two bones that it hangs on
  std::vector<Index> columns;   ///< the bone of the rig's skeleton that each is
  std::vector<Index> vertices;  ///< of the mesh, around the bones; ascending
  Vector shares;      ///< of the part's own weights in these vertices': 1 at its bones, 0 at its rim
  TriangleMesh mesh;  ///< its vertices and the triangles between them
};

/// The fine parts of a rig on its mesh, the larger ones first.
std::vector<FinePart> fine_parts(const RigShape& rig, const TriangleMesh& mesh, const WeldedVertices& welded);

}  // namespace arapfields
