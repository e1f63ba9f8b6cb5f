// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <optional>
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
  /// Adds samples at places of the mesh where none is. Returns the sample nearest to each, whose weights it
  /// has.
  std::vector<Index> add_samples(const MeshPlaces& places);
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
  Points energy_points;               ///< (n,3) positions of the energy samples
  Revision energy_revision = 0;       ///< of the energy samples
};

}  // namespace arapfields
