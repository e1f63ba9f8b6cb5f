// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "core/jets2d.h"
#include "core/task.h"
#include "options/curve.h"

namespace arapfields {

/// Gaussian centers exp(−|x − p_m|²/r_m²) in the plane, and the affine maps: centers first, then 1, x, y.
struct ARAPFIELDS_EXPORT CurveBasis {
  Points2 centers;  ///< (m,2)
  Vector radii;     ///< (m)

  Index size() const { return centers.rows() + 3; }
  /// (6n, size): the basis functions' own jets at points (n,2), column by column of the jet.
  RowMatrix<double> rows(Points2In points) const;
};

/// Centers at the nodes of a grid that have a point within 1.5 cells, and at all nodes of a grid three times
/// as coarse around the points; radii are twice the grid's spacing. Centers on the curve itself would be
/// poor: on a straight line, their functions have no derivative across it.
ARAPFIELDS_EXPORT CurveBasis curve_basis(Points2In points, double spacing);

/// A deformation of the plane, made for a curve. Points are in the curve's coordinates; the basis lives in
/// the square in which the curve's bounding box has half-extent 0.75.
struct ARAPFIELDS_EXPORT CurveField {
  Vec2 center = Vec2::Zero();
  double scale = 1.0;
  CurveBasis basis;
  RowMatrix<double> coefficients;  ///< (size,2)

  /// The identity, for this curve. Throws InvalidInput for no points, non-finite ones, or a single position.
  static CurveField around(Points2In points, double spacing);
  Points2 to_square(Points2In points) const { return (points.rowwise() - center.transpose()) / scale; }
  Points2 operator()(Points2In points) const;
  /// Jets in the square at points in the curve's coordinates; the first derivatives are the same in both.
  RowMatrix<double> jets(Points2In points) const;
};

/// Samples of the curve (indices) that a rigid motion of the plane, (3,3) homogeneous, is to move.
struct ARAPFIELDS_EXPORT CurveHandle {
  std::vector<Index> samples;
  Mat3 motion = Mat3::Identity();
  double weight = 1.0;

  /// InvalidInput that names, after `prefix`, what no curve has or can follow.
  void validate(const std::string& prefix = "") const;
};

struct CurveReport {
  double stretch = 0.0, bend = 0.0;                        ///< means over the samples, in the square
  double handle_error_mean = 0.0, handle_error_max = 0.0;  ///< in the curve's units
  double min_determinant = 0.0;                            ///< smallest det J at the samples
  Index iterations = 0;                                    ///< quasi-Newton steps taken
  double loss = 0.0;       ///< reached: stretch + λ_bend·bend, handles and smoothness
  bool converged = false;  ///< a further step would gain next to nothing
};

struct CurveSolution {
  CurveField field;
  CurveReport report;
};

/// Deforms a curve (samples (n,2)) as rigidly as possible so that the handles' samples follow their motions:
/// alternating rotations and a linear solve, then quasi-Newton on stretch + λ_bend·bend +
/// handle_weight·handles. Throws InvalidInput for no handles, indices out of range, and motions that are not
/// rigid.
ARAPFIELDS_EXPORT CurveSolution deform_curve(Points2In points, const std::vector<CurveHandle>& handles,
                                             const CurveOptions& options = {}, const Progress& progress = {});

}  // namespace arapfields
