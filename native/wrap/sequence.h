// SPDX-License-Identifier: GPL-3.0-or-later
// A surface that was wrapped onto the first frame of a scanned sequence, and follows the others.
#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "fields/composed_field.h"
#include "mesh/surface_samples.h"
#include "wrap/wrap.h"

namespace arapfields {

/// Follows the frames of a sequence, each from where the last one left the surface. Rigidity is measured from
/// the first frame, so that nothing drifts, and what moves less than the frames' noise is held. The first
/// field with one more after it is each frame's.
class ARAPFIELDS_EXPORT WrapSequence {
 public:
  /// `field` is what wrap found for the first frame, from these samples; or what next did, and then the
  /// sequence goes on behind that frame. Throws InvalidInput for bad options and samples, for others than
  /// those of that sequence, and for another kind of field.
  WrapSequence(const SurfaceSamples& samples, const DeformationField& field, const WrapOptions& options);

  /// Wraps onto the next frame: a function in the coordinates of the first. Throws InvalidInput that names
  /// `target` where there is no surface; Cancelled, with the sequence as it was. Any thread may call.
  WrapSolution next(const ImplicitFunction& target, const Progress& progress = {});

  /// (m,3) what changes from frame to frame: coefficients of the motion since the first one.
  Points state() const;
  /// Goes on behind the frame of this state. Throws InvalidInput for one of another sequence.
  void set_state(PointsIn state);
  /// From rest to the frame of the state.
  std::shared_ptr<DeformationField> field() const;

 private:
  std::shared_ptr<DeformationField> field_of(std::shared_ptr<const RadialField> motion) const;

  mutable std::mutex one_at_a_time_;
  WrapOptions options_;
  std::vector<FieldStep> first_;
  Frame frame_;
  Points kept_;     // rest points of the fields
  Points points_;   // (n,3) the surface in the first frame
  Points normals_;  // (n,3)
  Vector areas_;    // (n) shares of its area
  Vector weights_;  // (n) factors of its stiffness
  RadialBasis basis_;
  RowMatrix<double> coefficients_;
};

}  // namespace arapfields
