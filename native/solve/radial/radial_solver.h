// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/task.h"
#include "energies/handles.h"
#include "energies/style.h"
#include "fields/radial_field.h"
#include "mesh/surface_samples.h"
#include "options/live.h"
#include "solve/contact/contact.h"
#include "solve/mesh_measures.h"
#include "solve/radial/hooks.h"
#include "solve/radial/report.h"
#include "solve/radial/secondary_motion.h"

namespace arapfields {

class HandleBlend;
struct RadialState;
struct RestShape;

/// Minimises the energy of deform and stylize over radial fields, by preconditioned L-BFGS. Each solve starts
/// from the shape of the last one, for drags at interactive rates. For one thread at a time.
class ARAPFIELDS_EXPORT RadialSolver {
 public:
  /// Handles are in mesh coordinates; a style needs none. Solvers on the same samples may share their `shape`
  /// (solve/radial/rest_shape.h). With a blend (solve/radial/blend.h), the radial field inside it is solved
  /// for. Throws InvalidInput as deform does.
  RadialSolver(const SurfaceSamples& samples, const std::vector<Handle>& handles, const LiveOptions& options,
               const Progress& progress = {}, std::shared_ptr<const RestShape> shape = nullptr,
               std::shared_ptr<const HandleBlend> blend = nullptr);
  ~RadialSolver();
  RadialSolver(RadialSolver&&) noexcept;
  RadialSolver& operator=(RadialSolver&&) noexcept;

  /// Other handles for the same surface; the next solve starts from the current shape.
  void set_handles(const std::vector<Handle>& handles);
  /// A style of this strength ≥ 0 (0 removes it) and sharpness σ (0: the style's own). `weights`: one for
  /// each sample given to the constructor, or empty. Without handles, the lowest sample against `up` keeps
  /// its height, and the middle its place seen along `up`.
  void set_style(const Style& style, double strength, double sharpness, const Vector& weights = {},
                 const Vec3& up = Vec3::UnitZ());
  void clear_style();
  /// Other weights of the samples (mesh/surface_samples.h). The preconditioner is factored anew.
  void set_weights(const Vector& weights, const Vector& bend_weights = {});
  /// Makes the field symmetric across a plane through the origin of mesh coordinates, or not. The next solve
  /// starts from the nearest symmetric shape.
  void set_symmetry(SymmetryPlane symmetry, const Progress& progress = {});
  /// Energies that join the solver's own, and an observer of its steps.
  void set_hooks(const RadialHooks& hooks);
  /// Sets the contact constraints of later solves; none: no contact. Throws InvalidInput as require_contact()
  /// does, and with exact handles; Cancelled, without any change. `in_one_go`: targets jump to their final
  /// positions, unlike in a drag, so that a solve may try smaller steps towards them.
  void set_contact(const std::optional<Contact>& contact, bool in_one_go = false,
                   const Progress& progress = {});
  /// Moves the handles' targets.
  void set_targets(const std::vector<Handle>& moved);
  /// Improves the field for the current targets and style; 0 iterations or tolerance: the options'.
  std::shared_ptr<RadialField> solve(Index iterations = 0, double tolerance = 0.0,
                                     const Progress& progress = {});
  /// As solve(), but makes no field, and report() measures when it is called. Returns the number of steps.
  Index follow(Index iterations = 0, double tolerance = 0.0, const Progress& progress = {});
  /// Gives the surface a mass from the next step on; none, or strength 0: no mass. solve() finds the
  /// equilibrium. Throws InvalidInput for numbers out of range, and if all masses are zero.
  void set_secondary_motion(const std::optional<SecondaryMotion>& motion, const Progress& progress = {});
  /// Integrates the motion over a frame of this length in seconds (1e-5 to 10), in which the handles move to
  /// other targets. It starts at the end of the last step or solve; a solve ends with zero velocity.
  /// `coordinates` maps coordinates of the last step to those of this one, if the object itself has moved
  /// rigidly. Without a mass: set_targets() and solve(). If it throws, the state is unchanged.
  std::shared_ptr<RadialField> step(const std::vector<Handle>& moved, double seconds,
                                    const Progress& progress = {},
                                    const Mat4& coordinates = Mat4::Identity());
  /// The state that the next step starts from. Equal steps from equal states give bit-identical results.
  MotionState motion_state() const;
  void set_motion_state(const MotionState& state);
  /// Back to the identity, and the handles' targets to rest.
  void reset();
  /// Starts the next solve from a least-squares fit of another field, with the contact report of the solve
  /// that found it, whose trials are not repeated.
  void adopt(const DeformationField& field, const ContactReport& contact = {});

  /// The number of samples at which this field, the current one, folds, and of `places` of the mesh. If there
  /// are any, the places, these samples and the nearly folded ones join the samples of the energy, and the
  /// fold barrier gets this weight.
  Index add_fold_samples(double barrier, const DeformationField& now, const MeshPlaces& places = {});

  /// Points (n,3) in mesh coordinates at which tracked() evaluates the field, with precomputed basis values.
  /// `triangles` are those of the mesh whose vertices the points are; null: not known.
  void track(PointsIn points, std::shared_ptr<const Triangles> triangles = nullptr);
  PointsF tracked() const;

  std::shared_ptr<RadialField> field() const;
  /// The report of the last solve. After follow() the first call measures it, against the current targets.
  const RadialReport& report() const;
  const std::vector<Handle>& handles() const;

 private:
  std::unique_ptr<RadialState> state_;
};

}  // namespace arapfields
