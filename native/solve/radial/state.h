// SPDX-License-Identifier: GPL-3.0-or-later
// What a live solver holds, and how it solves.
#pragma once

#include <memory>

#include "fields/mirror.h"
#include "fields/tracked_points.h"
#include "solve/radial/body.h"
#include "solve/radial/objective.h"
#include "solve/radial/radial_solver.h"
#include "solve/radial/time_scheme.h"
#include "solve/surface_stiffness.h"

namespace arapfields {

class RadialSolver::State {
 public:
  State(const SurfaceSamples& samples, const std::vector<Handle>& handles, const LiveOptions& options,
        const Progress& progress, std::shared_ptr<const RestShape> shape,
        std::shared_ptr<const HandleBlend> blend);
  void set_handles(const std::vector<Handle>& handles);
  void set_style(const Style& style, double strength, double sharpness, const Vector& weights,
                 const Vec3& up);
  void clear_style();
  void set_hooks(const RadialHooks& hooks);
  void set_weights(const Vector& weights, const Vector& bend_weights);
  void set_targets(const std::vector<Handle>& moved);
  Index follow(Index iterations, double tolerance, const Progress& progress);
  std::shared_ptr<RadialField> solve(Index iterations, double tolerance, const Progress& progress);
  void set_secondary_motion(const std::optional<SecondaryMotion>& motion);
  std::shared_ptr<RadialField> step(const std::vector<Handle>& moved, double seconds, const Mat4& coordinates,
                                    const Progress& progress);
  MotionState motion_state() const;
  void set_motion_state(const MotionState& state);
  void reset();
  void adopt(const DeformationField& field);
  Index watch_folds(double barrier);
  void track(PointsIn points);
  /// The same session, symmetric otherwise: its handles, targets, style, hooks, shape and tracked points.
  std::unique_ptr<State> with_symmetry(SymmetryPlane symmetry, const Progress& progress) const;
  PointsF tracked() const { return tracked_.moved(coefficients_); }
  std::shared_ptr<RadialField> field() const;
  const RadialReport& report();
  const std::vector<Handle>& handles() const { return handles_; }
  const LiveOptions& options() const { return options_; }

 private:
  template <class Scalar>
  using Precision = RadialPrecision<Scalar>;
  template <class Scalar>
  void prepare(Precision<Scalar>& precision);
  template <class Scalar>
  QuasiNewtonReport descend(Precision<Scalar>&, const QuasiNewtonOptions&, const Progress&);
  template <class Scalar>
  void measure(Precision<Scalar>& precision);
  template <class Call>
  void for_each_precision(Call&& call) {
    if (fast_.objective) call(fast_);
    if (exact_.objective) call(exact_);
  }
  std::pair<Vector, Vector> resistance() const;
  RadialStyle style_at_samples(const StyleAsked& asked) const;
  void stiffen(const Progress& progress), choose_smoothing(double h);
  bool choose_influence();
  std::shared_ptr<const Influence> reaches_of_handles() const;
  Points pair_targets() const;
  int solve_threads() const;
  template <class S>
  void weigh(Precision<S>& precision, double inertia = 0.0, PointsOf<S> goal = {});
  void precondition(double inertia);
  void choose_pairs(), reflect_pairs(), choose_stance(), stand_otherwise(), factorise();
  void follow_rigidly(), extrapolate(), hold_lowest(), forget_past(), rest();
  Points pair_targets_between(const std::vector<Mat4>& before, double share) const;
  bool swing(const TimeScheme& scheme, double h, const Twist& carried, const Progress& progress);
  double left_along(const VectorF& du, double inertia);
  RowMatrix<double> smooth(const RowMatrix<double>& velocities) const;
  void change_coordinates(const Mat4& motion), advance(double seconds, const Progress& progress);
  double kinetic_energy();

  LiveOptions options_;
  SurfaceSamples samples_;
  Frame frame_;
  Points surface_, surface_normals_;          // all samples, cube coordinates
  std::shared_ptr<const HandleBlend> blend_;  // null: handles are soft
  std::vector<std::uint32_t> order_;          // of these, neighbours beside each other
  std::vector<Index> chosen_;                 // those that the energy sees
  SurfaceStiffness surface_stiffness_;        // without weights of the samples
  Vector own_bending_;                        // λ of these, without bend weights
  Vector bending_, weights_;                  // λ, and factors of the energy (empty: all 1)
  std::optional<Mirror> mirror_;              // where the field is symmetric
  std::vector<Handle> handles_;
  BoundHandles bound_;
  std::vector<Index> pair_rows_;  // rows of bound_ that pull
  RadialBasis basis_;
  std::shared_ptr<const Influence> reaches_;    // of handles that reach so far only; null: there are none
  std::shared_ptr<const Influence> influence_;  // these, unless a handle without a reach moves
  Points held_;                                 // samples beyond it, which are held in place
  HandleBatch<double> pairs_;                   // of handles, of what is held, and reflections of both
  RowMatrix<double> stiffness_, pair_values_, inverse_factor_;
  std::optional<RadialStyle> style_;
  std::optional<StyleAsked> style_asked_;
  RadialHooks hooks_;
  Vec3 up_ = Vec3::UnitZ();
  std::optional<RadialStance> stance_;
  Precision<float> fast_;    // what a drag needs
  Precision<double> exact_;  // what follows where more is asked for; made when it first is
  QuasiNewton optimizer_;
  RowMatrix<double> coefficients_;
  RowMatrix<double> coefficients_before_;  // where the solve before the last one ended; empty: not known
  VectorF u_before_;
  RadialBody body_;
  TrackedPoints tracked_;
  Points tracked_rest_;
  RadialReport report_;
  bool is_measured_ = true;  // whether the report is of the shape at hand
  bool is_exact_ = false;    // whether that came of double precision
};

}  // namespace arapfields
