// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "core/task.h"
#include "fields/field.h"
#include "splats/gaussian_splats.h"
#include "splats/splat_column.h"

namespace arapfields {

/// Splats that are moved together: neighbours in space.
struct SplatGroup {
  std::vector<Index> rows;   ///< of the splats at rest
  std::vector<Index> broad;  ///< of `rows`, by their place there: those that a field may bend

  /// Centers (mesh coordinates) at which the field's jets of this order are needed: all, or the broad ones'.
  Points places(const GaussianSplats& rest, JetOrder order) const;
  /// All splats, in groups. `scale`: the cube's, in mesh units.
  static std::vector<SplatGroup> of(const GaussianSplats& splats, double scale);
};

/// Jets at a group's centers in the cube: first ones of all, or second ones of the broad.
template <class Scalar>
using SplatJets = std::function<void(std::size_t group, JetView<Scalar>)>;

/// What is moved by a field with these jets, and divided where that needs it (move_splats.h). The jets of new
/// splats are those of `field`. Memory that `moved` has is used again.
template <class Scalar>
GaussianSplats moved_groups(GaussianSplats moved, const DeformationField& field, const GaussianSplats& rest,
                            const std::vector<SplatGroup>& groups, const SplatJets<Scalar>& jets,
                            double max_stretch, const Progress& progress);

/// Centers (n,3) that are moved by a field with these jets, and what it adds to these columns
/// (PreparedSplats::changes()); none is divided.
template <class Scalar>
PointsF changed_columns(const Frame& frame, const GaussianSplats& rest, const std::vector<SplatGroup>& groups,
                        const SplatJets<Scalar>& jets, const std::vector<SplatColumn>& columns,
                        const Progress& progress);

/// Jets that the field is asked for.
SplatJets<double> jets_of(const DeformationField& field, const GaussianSplats& rest,
                          const std::vector<SplatGroup>& groups);

}  // namespace arapfields
