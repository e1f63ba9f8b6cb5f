// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "mesh/surface_samples.h"
#include "options/wrap.h"
#include "wrap/alignment.h"

namespace arapfields {

/// Which landmarks a wrap follows, by row.
struct LandmarkVerdict {
  std::vector<Index> kept, left_out;
};

/// Leaves out pairs that contradict the others. Similarities that most pairs agree with come from triples of
/// them (Fischler, Bolles 1981, "Random Sample Consensus"), and a coarse, softly pulled wrap from each then
/// says what stays far from its target, unless a firm pull brings it there without stretch, or the surface
/// nearer to the target. Where too many do, all are kept and `warnings` says so. Throws InvalidInput where
/// the pairs are those of a mirror image.
LandmarkVerdict trusted_landmarks(const SurfaceSamples& samples, const WrapSource& source,
                                  const WrapTarget& target, const WrapOptions& options,
                                  std::vector<std::string>& warnings, const Progress& progress);

}  // namespace arapfields
