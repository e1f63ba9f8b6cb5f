// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "energies/distortion.h"
#include "fields/radial_field.h"
#include "fields/tracked_points.h"
#include "mesh/surface_samples.h"
#include "solve/live_objective.h"

namespace arapfields {

/// Options of a live solve. Lengths and weights refer to the unit cube of the samples' frame.
struct LiveOptions {
  int samples = 2000;          ///< surface samples that the energy sees
  int coarse_bumps = 60;       ///< bumps of the coarse scale (0: none)
  int fine_bumps = 300;        ///< bumps of the fine scale
  double coarse_reach = 3.0;   ///< radius of the coarse bumps as a multiple of their spacing
  double fine_reach = 4.0;     ///< the same of the fine bumps
  double bending = 0.01;       ///< λ_bend
  double handle_weight = 100;  ///< factor of the handles' mean squared distance
  int handle_samples = 300;    ///< samples that a handle pulls at, at most
  int steps = 12;              ///< quasi-Newton steps of one solve, at most
  double tolerance = 1e-4;     ///< a solve ends where a step is expected to gain less than this share
  double gauss_weight = 6.0;   ///< λ_Gauss of a style at strength 1
  double barrier = 0.0;        ///< weight of the barrier against folds
  double barrier_threshold = 0.1;
  int threads = 0;  ///< 0: all for the set-up, and for a solve where that is large
  std::int64_t seed = 0;
  void validate() const;  ///< throws InvalidInput that names the option
};

/// What a solve reached, measured at its own samples; energies in the unit cube, lengths in mesh units.
struct LiveReport {
  ArapValue arap;
  double energy = 0.0;  ///< stretch + bending · bend
  double value = 0.0;   ///< all that is minimised
  double handle_mean = 0.0, handle_max = 0.0;
  std::optional<double> preference;  ///< mean g of the deformed normals, where there is a style
  Distortion distortion;
  Index steps = 0, evaluations = 0;
  bool converged = false;
  double setup_seconds = 0.0, seconds = 0.0;
};

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
  /// Improves the field for the targets and the style at hand; 0 steps or tolerance: the options'.
  std::shared_ptr<RadialField> solve(Index steps = 0, double tolerance = 0.0, const Progress& progress = {});
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
