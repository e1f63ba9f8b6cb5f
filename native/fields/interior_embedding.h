// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/jets.h"
#include "core/types.h"
#include "fields/interior_distance.h"

namespace arapfields {

/// An embedding ψ: R³ → R³ that separates parts which are near in space but far apart inside the shape:
/// |x − y|² + |ψ(x) − ψ(y)|² approximates the squared interior distance from x to y. ψ is given by values and
/// gradients at nodes of the surface and blended between them with normalised Gaussian weights, as wide as
/// the nodes' spacing (Franke and Little's modification of Shepard's method).
struct ARAPFIELDS_EXPORT InteriorEmbedding {
  Points nodes;              ///< (n,3)
  Points values;             ///< (n,3) ψ at the nodes
  RowMatrix<double> slopes;  ///< (n,9) ∂ψ_k/∂x_i at 3 k + i
  double width = 0.0;        ///< of the Gaussians e^{−|x|²/width²}

  /// Jets of ψ at points (n,3), of any order.
  void evaluate(PointsIn points, JetView<double> out) const;
};

/// ψ of a surface from samples (n,3) and their outward normals, by landmark multidimensional scaling (de
/// Silva, Tenenbaum 2004) of the squared interior distances minus the squared Euclidean ones. Null if these
/// hardly differ, and for less than a hundred distinct samples. With an axis (0, 1, 2), samples are those
/// where that coordinate is positive, whose reflections are added, and ψ is symmetric: interior distances
/// from x to y and from S x to S y are equal. `may_join`: whether an edge of the graph may join two samples;
/// none: always; without an axis only.
ARAPFIELDS_EXPORT std::shared_ptr<const InteriorEmbedding> interior_embedding(PointsIn samples,
                                                                              PointsIn normals, int axis = -1,
                                                                              const MayJoin& may_join = {});

}  // namespace arapfields
