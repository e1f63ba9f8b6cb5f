// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "fields/radial_field.h"
#include "fields/tracked_points.h"
#include "mesh/surface_samples.h"
#include "options/live.h"
#include "solve/live_objective.h"
#include "solve/live_report.h"

namespace arapfields {

/// Deforms a surface at interactive rates: the energy of deform (and stylize) over a radial field, solved
/// from where the last solve ended. Serves one caller at a time.
class LiveSolver {
 public:
  /// Handles in mesh coordinates; none are needed where a style follows. Throws InvalidInput as deform does.
  LiveSolver(const SurfaceSamples& samples, const std::vector<Handle>& handles, const LiveOptions& options,
             const Progress& progress = {});

  /// Other handles for the same surface; the shape at hand stays the start of the next solve.
  void set_handles(const std::vector<Handle>& handles);
  /// Preferred normals (k,3), strength ≥ 0 (0 takes the style away), sharpness σ, and weights (one for each
  /// surface sample given to the constructor, or empty).
  void set_style(PointsIn preferred, double strength, double sharpness, const Vector& weights = {});
  void clear_style();
  /// Moves the handles' targets.
  void set_targets(const std::vector<Handle>& moved);
  /// Improves the field for the targets and the style at hand; 0 iterations or tolerance: the options'.
  std::shared_ptr<RadialField> solve(Index iterations = 0, double tolerance = 0.0,
                                     const Progress& progress = {});
  /// Back to the identity, and the handles' targets to rest.
  void reset();

  /// Points (n,3) of mesh coordinates whose places tracked() tells cheaply.
  void track(PointsIn points) { tracked_ = TrackedPoints(basis_, frame_, points); }
  PointsF tracked() const { return tracked_.moved(coefficients_); }

  std::shared_ptr<RadialField> field() const;
  const LiveReport& report() const { return report_; }
  const std::vector<Handle>& handles() const { return handles_; }

 private:
  template <class Scalar>
  struct Precision {
    std::unique_ptr<LiveObjective<Scalar>> objective;
    Eigen::VectorX<Scalar> u;  // measurements of the coefficients; empty: not known
    int uses = 0;              // solves since u was measured afresh
  };
  template <class Scalar>
  void prepare(Precision<Scalar>& precision);
  template <class Scalar>
  QuasiNewtonReport descend(Precision<Scalar>& precision, const QuasiNewtonOptions& options,
                            const Progress& progress);
  template <class Scalar>
  void measure(Precision<Scalar>& precision);
  template <class Call>
  void for_each_precision(Call&& call);
  void choose_pairs();
  void follow_rigidly();
  void extrapolate();
  void hold_lowest();
  int solve_threads() const;

  LiveOptions options_;
  Frame frame_;
  Points surface_, surface_normals_;  // all samples, cube coordinates
  std::vector<Index> chosen_;         // those that the energy sees
  std::vector<Handle> handles_;
  BoundHandles bound_;
  std::vector<Index> pair_rows_;  // rows of bound_ that pull
  RadialBasis basis_;
  HandleBatch<double> pairs_;
  RowMatrix<double> stiffness_, pair_values_, inverse_factor_;
  std::optional<LiveStyle> style_;
  double style_strength_ = 0.0;
  Precision<float> fast_;    // what a drag needs
  Precision<double> exact_;  // what follows where more is asked for; made when it first is
  QuasiNewton optimizer_;
  RowMatrix<double> coefficients_;
  RowMatrix<double> coefficients_before_;  // where the solve before the last one ended; empty: not known
  VectorF u_before_;
  TrackedPoints tracked_;
  LiveReport report_;
};

}  // namespace arapfields
