// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/task.h"
#include "fields/field.h"
#include "splats/gaussian_splats.h"
#include "splats/splat_column.h"

namespace arapfields {

constexpr double default_max_stretch = 2.0;

/// Splats moved by a field: μ' = f(μ), Σ' = J Σ Jᵀ. The axes stay in their order. Colours turn by the
/// rotation closest to J; opacities stay. A Gaussian that the field stretches by more than `max_stretch`
/// along an axis, or bends, is divided into two along it first, which have its mean and covariance together.
/// Each such half is σ/2 wide and √3/2 σ away. Splats keep their rows; what is new comes after them. Throws
/// InvalidInput for splats that do not fit together and for max_stretch < 1, and Cancelled.
ARAPFIELDS_EXPORT GaussianSplats move_splats(const DeformationField& field, const GaussianSplats& splats,
                                             double max_stretch = default_max_stretch,
                                             const Progress& progress = {});

/// Splats that are moved again and again, as in live mode. What radial fields of one basis need at their
/// centers is prepared for the first such field, and kept until one of another basis comes. They are moved in
/// single precision: errors are some 1e-5 of the size. Other fields, and those with a reach, move them as
/// move_splats() does.
class ARAPFIELDS_EXPORT PreparedSplats {
 public:
  /// Throws InvalidInput for splats that do not fit together.
  explicit PreparedSplats(GaussianSplats splats);
  ~PreparedSplats();
  PreparedSplats(PreparedSplats&&) noexcept;

  /// As move_splats(). Thread-safe. Memory that `into` has is used again: new memory for a million splats
  /// takes as long as their pose.
  GaussianSplats moved(const DeformationField& field, double max_stretch = default_max_stretch,
                       const Progress& progress = {}, GaussianSplats into = {}) const;
  /// Where moved() has the centers (n,3) if it divides no splat. What else a motion changes is written to
  /// `columns`: rotations (w, x, y, z), logarithms of the scales, then all harmonics but the first, channel
  /// by channel, with the splats' own numbers at rest. Throws InvalidInput for another number of columns.
  PointsF changes(const DeformationField& field, const std::vector<SplatColumn>& columns,
                  const Progress& progress = {}) const;
  const GaussianSplats& rest() const;

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace arapfields
