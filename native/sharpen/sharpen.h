// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "core/task.h"
#include "energies/style.h"
#include "options/sharpen.h"
#include "solve/contact/contact.h"

namespace arapfields {

/// As StylizeOptions::centers and iterations, enough for a field whose result sharpen() finishes.
inline constexpr int centers_before_sharpen = 500, iterations_before_sharpen = 60;

/// Brings a mesh that a field has stylized nearer to its style, by its own vertices: (n,3) of `moved`,
/// sharpened. In turns, each vertex gets the rotation that fits its edges best, each triangle loses what its
/// edges have along the preferred normal nearest to its own (of an object's style: its target), where that is
/// within reach, and a constant system gives the positions (Bouaziz et al. 2012, "Shape-Up"; Liu and Jacobson
/// 2019, "Cubic Stylization"). No triangle is folded that is not in `moved` (folded_triangles()): around
/// those that cannot be opened the result goes back to `moved`. `weights` (n; empty: all 1) scale the effect
/// at each vertex; where they are 0 vertices stay. Vertices of one place that have stayed together do so;
/// loose vertices stay, too. With `up`, and no vertex held, the lowest along it keeps its height. In
/// `contact`, vertices enter no obstacle and do not pass the ground; those that are inside or nearer than a
/// margin in `moved` go no further. Self-contact is refused: it would take searches for other parts in each
/// step. A strength below 1 is that of the field as well: the result lies that share of the way from rest to
/// the style's whole shape, so that `moved` does, too. Where not `alone`, or in contact, strength scales the
/// style's weight, as it does in stylize(). Throws InvalidInput for a broken mesh, for moved vertices,
/// weights or options that do not fit; Cancelled.
ARAPFIELDS_EXPORT Points sharpen(PointsIn vertices, TrianglesIn triangles, PointsIn moved, const Style& style,
                                 const SharpenOptions& options = {}, const Progress& progress = {},
                                 const Vector& weights = {}, const std::optional<Vec3>& up = {},
                                 const Contact& contact = {}, bool alone = true);

}  // namespace arapfields
