// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/task.h"
#include "energies/handles.h"
#include "energies/style.h"
#include "fields/radial_field.h"
#include "mesh/surface_samples.h"
#include "options/live.h"
#include "solve/radial/hooks.h"
#include "solve/radial/report.h"
#include "solve/radial/secondary_motion.h"

namespace arapfields {

class HandleBlend;
struct RestShape;

/// Deforms a surface at interactive rates: the energy of deform (and stylize) over a radial field, solved
/// from where the last solve ended. Serves one caller at a time.
class ARAPFIELDS_EXPORT RadialSolver {
 public:
  /// Handles in mesh coordinates; none are needed where a style follows. `shape` (solve/radial/rest_shape.h)
  /// is that of the samples where several solvers share it. With a blend (solve/radial/blend.h), what is
  /// solved for is the radial field inside it. Throws InvalidInput as deform does.
  RadialSolver(const SurfaceSamples& samples, const std::vector<Handle>& handles, const LiveOptions& options,
               const Progress& progress = {}, std::shared_ptr<const RestShape> shape = nullptr,
               std::shared_ptr<const HandleBlend> blend = nullptr);
  ~RadialSolver();
  RadialSolver(RadialSolver&&) noexcept;
  RadialSolver& operator=(RadialSolver&&) noexcept;

  /// Other handles for the same surface; the shape at hand stays the start of the next solve.
  void set_handles(const std::vector<Handle>& handles);
  /// A style, strength ≥ 0 (0 takes the style away), sharpness σ (0: from the style),
  /// weights (one for each surface sample given to the constructor, or empty); `up` is where the figure's
  /// head is: without handles it stands on what lies lowest.
  void set_style(const Style& style, double strength, double sharpness, const Vector& weights = {},
                 const Vec3& up = Vec3::UnitZ());
  void clear_style();
  /// Other weights of the samples (mesh/surface_samples.h), for instance while they are painted. What they
  /// enter is factored anew; moving handles does not ask for it.
  void set_weights(const Vector& weights, const Vector& bend_weights = {});
  /// Makes the field symmetric across a plane through the origin of the mesh's coordinates, or no longer so,
  /// from the next solve on; the shape at hand is the start, as nearly as it can be.
  void set_symmetry(SymmetryPlane symmetry, const Progress& progress = {});
  /// Energies that join the solver's own, and an observer of its steps.
  void set_hooks(const RadialHooks& hooks);
  /// Moves the handles' targets.
  void set_targets(const std::vector<Handle>& moved);
  /// Improves the field for the targets and the style at hand; 0 iterations or tolerance: the options'.
  std::shared_ptr<RadialField> solve(Index iterations = 0, double tolerance = 0.0,
                                     const Progress& progress = {});
  /// The same for the shape alone, of which report() is measured when it is asked for; returns the steps
  /// taken.
  Index follow(Index iterations = 0, double tolerance = 0.0, const Progress& progress = {});
  /// Gives the surface a mass, from the next step on; none, or strength 0: it has none. Solves then find
  /// where it would come to rest. Throws InvalidInput for what cannot be, masses of zero alone among it.
  void set_secondary_motion(const std::optional<SecondaryMotion>& motion);
  /// Moves the handles to other targets in so many seconds (1e-5 to 10), and the body with them, from where
  /// the last step or solve ended (a solve ends at rest). Where the object to which all coordinates belong
  /// has moved meanwhile, `coordinates` is the rigid motion that takes those of the last step to those of
  /// this one: the body feels it. Without a mass, set_targets() and solve(). Where it throws, nothing has
  /// moved.
  std::shared_ptr<RadialField> step(const std::vector<Handle>& moved, double seconds,
                                    const Progress& progress = {},
                                    const Mat4& coordinates = Mat4::Identity());
  /// All that the next step depends on: the same steps from it are the same, bit for bit.
  MotionState motion_state() const;
  void set_motion_state(const MotionState& state);
  /// Back to the identity, and the handles' targets to rest.
  void reset();
  /// Takes another field's shape, as well as its own centers can, as the start of the next solve. In the
  /// samples' frame.
  void adopt(const DeformationField& field);

  /// How many samples the shape at hand folds at. If any, the next solves look at all samples that it folds
  /// at or nearly does, whether the energy saw them or not, with this weight of the barrier.
  Index watch_folds(double barrier);

  /// Points (n,3) of mesh coordinates whose places tracked() tells cheaply.
  void track(PointsIn points);
  PointsF tracked() const;

  std::shared_ptr<RadialField> field() const;
  /// What the last solve reached; after follow() it is measured at the first call, against the targets at
  /// hand.
  const RadialReport& report() const;
  const std::vector<Handle>& handles() const;

 private:
  class State;
  std::unique_ptr<State> state_;
};

/// Its first name, for one release more.
using LiveSolver = RadialSolver;

}  // namespace arapfields
