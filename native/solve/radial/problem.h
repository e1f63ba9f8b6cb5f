// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/dependent.h"
#include "core/task.h"
#include "fields/handle_blend.h"
#include "fields/mirror.h"
#include "fields/radial_basis.h"
#include "mesh/surface_samples.h"
#include "options/live.h"
#include "solve/mesh_measures.h"
#include "solve/radial/rest_shape.h"
#include "solve/surface_stiffness.h"

namespace arapfields {

/// The discretisation of a RadialSolver: the surface, the basis of its fields, and the samples at which the
/// energy is evaluated. In cube coordinates.
struct RadialProblem {
  /// `rest_shape` and `exact_handles` may be null. Throws InvalidInput for samples that cannot be used.
  RadialProblem(const SurfaceSamples& surface, const LiveOptions& solver_options, const Progress& progress,
                std::shared_ptr<const RestShape> rest_shape,
                std::shared_ptr<const HandleBlend> exact_handles);

  const Points& surface() const { return samples.points; }
  const Frame& frame() const { return samples.frame; }
  void add_energy_samples(const std::vector<Index>& rows);
  /// Adds samples at places of the mesh where none is, with the weights of the samples nearest to them;
  /// returns the rows of these places.
  std::vector<Index> add_samples(const MeshPlaces& places);
  /// Numbers at the samples that were given (none: empty), for all samples: added ones have that of the
  /// nearest given one. Throws InvalidInput that names the argument for another number of them.
  Vector at_all(const std::string& argument, const Vector& given) const;
  /// How many samples were given.
  Index given_count() const { return samples.size() - static_cast<Index>(alike.size()); }
  /// The samples as they were given, but for their frame with symmetry, and their weights.
  SurfaceSamples given_samples() const;
  /// Relative area that each energy sample stands for, 1 on average; empty: all alike.
  Vector energy_areas() const;
  /// Adds samples of the energy in the fine regions.
  void refine();
  /// Threads of a solve; 1 for a small problem.
  int solve_threads() const;

  LiveOptions options;
  SurfaceSamples samples;  ///< with symmetry, in a frame whose center is on the symmetry plane
  std::shared_ptr<const RestShape> shape;
  std::shared_ptr<const HandleBlend> blend;  ///< null: handles are soft
  std::optional<Mirror> mirror;              ///< of symmetric fields
  RadialBasis basis;
  SurfaceStiffness stiffness;         ///< λ without the samples' own bend weights
  std::vector<Index> energy_samples;  ///< rows of the samples
  std::vector<Index> alike;           ///< of added samples the given ones that are nearest
  Vector areas;                       ///< (samples; empty: all 1) relative area that each stands for
  Points energy_points;               ///< (n,3) positions of the energy samples
  Revision energy_revision = 0;       ///< of the energy samples
};

}  // namespace arapfields
