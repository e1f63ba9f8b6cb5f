// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "core/task.h"
#include "energies/handles.h"
#include "energies/style.h"
#include "fields/radial_field.h"
#include "mesh/surface_samples.h"
#include "options/live.h"
#include "solve/live_hooks.h"
#include "solve/live_report.h"

namespace arapfields {

class HandleBlend;
struct RestShape;

/// Deforms a surface at interactive rates: the energy of deform (and stylize) over a radial field, solved
/// from where the last solve ended. Serves one caller at a time.
class ARAPFIELDS_EXPORT LiveSolver {
 public:
  /// Handles in mesh coordinates; none are needed where a style follows. `shape` (solve/rest_shape.h) is that
  /// of the samples where several solvers share it. With a blend (solve/live_blend.h), what is solved for is
  /// the radial field inside it. Throws InvalidInput as deform does.
  LiveSolver(const SurfaceSamples& samples, const std::vector<Handle>& handles, const LiveOptions& options,
             const Progress& progress = {}, std::shared_ptr<const RestShape> shape = nullptr,
             std::shared_ptr<const HandleBlend> blend = nullptr);
  ~LiveSolver();
  LiveSolver(LiveSolver&&) noexcept;
  LiveSolver& operator=(LiveSolver&&) noexcept;

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
  void set_hooks(const LiveHooks& hooks);
  /// Moves the handles' targets.
  void set_targets(const std::vector<Handle>& moved);
  /// Improves the field for the targets and the style at hand; 0 iterations or tolerance: the options'.
  std::shared_ptr<RadialField> solve(Index iterations = 0, double tolerance = 0.0,
                                     const Progress& progress = {});
  /// Back to the identity, and the handles' targets to rest.
  void reset();
  /// Takes another field's shape, as well as its own centers can, as the start of the next solve. In the
  /// samples' frame.
  void adopt(const DeformationField& field);

  /// Points (n,3) of mesh coordinates whose places tracked() tells cheaply.
  void track(PointsIn points);
  PointsF tracked() const;

  std::shared_ptr<RadialField> field() const;
  const LiveReport& report() const;
  const std::vector<Handle>& handles() const;

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace arapfields
