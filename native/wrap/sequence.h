// SPDX-License-Identifier: GPL-3.0-or-later
// Tracking of a surface, wrapped onto the first frame of a scanned sequence, through the other frames.
#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "fields/composed_field.h"
#include "mesh/surface_samples.h"
#include "wrap/wrap.h"

namespace arapfields {

/// Tracks a surface through the frames of a sequence, each starting from the last one. Rigidity is measured
/// relative to the first frame, against drift, and points that move less than the frames' noise are held in
/// place. A frame's field is the first one's followed by one radial field.
class ARAPFIELDS_EXPORT WrapSequence {
 public:
  /// `field` is wrap's result for the first frame, from these samples; or next's, to continue after that
  /// frame. Throws InvalidInput for bad options and samples, for samples of another sequence, and for another
  /// kind of field.
  WrapSequence(const SurfaceSamples& samples, const DeformationField& field, const WrapOptions& options);

  /// Wraps onto the next frame: a function in the coordinates of the first. Throws InvalidInput that names
  /// `target` if it has no surface; Cancelled, with the state unchanged. Any thread may call.
  WrapSolution next(const ImplicitFunction& target, const Progress& progress = {});

  /// The state of a frame: coefficients (m,3) of the motion since the first one.
  Points state() const;
  /// Continues after the frame of this state. Throws InvalidInput for one of another sequence.
  void set_state(PointsIn state);
  /// The field from rest to the frame of the state.
  std::shared_ptr<DeformationField> field() const;

 private:
  std::shared_ptr<DeformationField> field_of(std::shared_ptr<const RadialField> motion) const;

  mutable std::mutex one_at_a_time_;
  WrapOptions options_;
  std::vector<FieldStep> first_;
  Frame frame_;
  Points kept_;     // rest points that the fields store
  Points points_;   // (n,3) the surface in the first frame
  Points normals_;  // (n,3)
  Vector areas_;    // (n) shares of its area
  Vector weights_;  // (n) factors of its stiffness
  RadialBasis basis_;
  RowMatrix<double> coefficients_;
};

}  // namespace arapfields
