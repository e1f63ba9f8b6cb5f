// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/jets.h"
#include "core/types.h"
#include "fields/interior_distance.h"

namespace arapfields {

/// Three smooth functions ψ on R³ that separate parts which are near in space but far apart inside the shape:
/// |x − y|² + |ψ(x) − ψ(y)|² is about the squared interior distance from x to y. ψ is given with its slope at
/// nodes of the surface and blended between them, with Gaussian weights as wide as
/// the nodes are apart and a sum of one (Franke and Little's modification of Shepard's method).
struct ARAPFIELDS_EXPORT InteriorEmbedding {
  Points nodes;              ///< (n,3)
  Points values;             ///< (n,3) ψ at the nodes
  RowMatrix<double> slopes;  ///< (n,9) ∂ψ_k/∂x_i at 3 k + i
  double width = 0.0;        ///< of the Gaussians e^{−|x|²/width²}

  /// Jets of ψ at points (n,3), of any order.
  void evaluate(PointsIn points, JetView<double> out) const;
};

/// ψ of a surface from samples (n,3) and their outward normals: the embedding that best explains by how much
/// interior distances exceed straight ones (landmark multidimensional scaling: de Silva, Tenenbaum 2004).
/// Null where they hardly do, and for less than a hundred different samples. With an axis (0, 1, 2), samples
/// lie where that coordinate is positive, stand for their reflections too, and ψ is symmetric: the interior
/// distances from x to y and from S x to S y are the same. `may_join` tells of two samples whether a way may
/// lead straight from one to the other, none: always; without an axis.
ARAPFIELDS_EXPORT std::shared_ptr<const InteriorEmbedding> interior_embedding(PointsIn samples,
                                                                              PointsIn normals, int axis = -1,
                                                                              const MayJoin& may_join = {});

}  // namespace arapfields
