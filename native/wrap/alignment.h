// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "wrap/target.h"
#include "wrap/wrap.h"

namespace arapfields {

/// What is to be aligned: points (n,3) of a surface in their cube with normals (n,3), and landmarks on it.
struct WrapSource {
  Points points, normals;
  Points landmarks;  ///< (k,3)
  Points ends;       ///< (k,3) where these belong on the target
  Frame frame;
};

/// Throws InvalidInput that names a landmark which is not finite or far off its surface, and two of which one
/// surface has in one place and the other has not.
void check_landmarks(const WrapSource& source, const WrapTarget& target);

/// The motion of the whole, cube → the target's coordinates, with which a wrap begins: by three landmarks or
/// more, else by the best of many turns about the principal axes, each brought closer point by point (Besl
/// and McKay 1992). Adds notes on what looks wrong.
Similarity wrap_alignment(const WrapSource& source, const WrapTarget& target, AlignmentKind kind, double turn,
                          std::vector<std::string>& notes, const Progress& progress);

}  // namespace arapfields
