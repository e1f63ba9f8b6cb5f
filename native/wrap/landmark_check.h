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

/// Finds outliers among the landmark pairs. Candidate similarities come from triples of pairs (Fischler,
/// Bolles 1981, "Random Sample Consensus"). A coarse wrap from each, with a low landmark weight, shows the
/// pairs that stay far from their targets; one of them is kept after all if a high weight brings it there
/// with little more stretch, or relaxes the surface. With too many outliers all pairs are
/// kept, with a warning. Throws InvalidInput if the pairs are those of a mirror image.
LandmarkVerdict trusted_landmarks(const SurfaceSamples& samples, const WrapSource& source,
                                  const WrapTarget& target, const WrapOptions& options,
                                  std::vector<std::string>& warnings, const Progress& progress);

}  // namespace arapfields
