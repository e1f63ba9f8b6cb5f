// SPDX-License-Identifier: GPL-3.0-or-later
#include "extraction/extract_surface.h"

#include <chrono>
#include <limits>
#include <optional>

#include "core/errors.h"
#include "extraction/adaptive_mesh.h"
#include "extraction/marching_cubes.h"

namespace arapfields {
namespace {

constexpr int smallest_with_model = 32;  // below, the model would cost more than the grid
constexpr int grid_steps_a_cell = 4;
constexpr int grid_steps_a_sure_cell = 2;  // where Φ's own bound on |∇Φ| makes interpolation needless
constexpr int fewest_coarse_cells = 8;     // a side
constexpr int finest_resolution = 512;     // allowed …
constexpr int finest_refined = 2048;       // … and to which thin parts are refined
constexpr Index points_a_thin_cell = 24;   // about, that cutting its edges in three takes

/// Cells of about the same number of grid steps at every resolution.
TricubicSurrogateOptions model_options(int resolution, bool sure) {
  TricubicSurrogateOptions options{.target_cells = std::numeric_limits<Index>::max(), .interpolate = !sure};
  const int finest = resolution / (sure ? grid_steps_a_sure_cell : grid_steps_a_cell);
  int halvings = 0;
  while (finest >> (halvings + 1) >= fewest_coarse_cells) ++halvings;
  options.coarsest = finest >> halvings;
  options.max_cells_a_side = options.coarsest << halvings;
  return options;
}

/// Leaves out the triangles with a corner at which |Φ| exceeds what a crossing of the grid can leave there.
/// Whether there were any.
bool drop_jumps(EvaluationCounter& function, double most, TriangleMesh& mesh) {
  const VectorF values = function.values(mesh.vertices.cast<float>());
  std::vector<std::int32_t> number(mesh.vertices.rows(), -1);
  std::vector<Index> kept, used;
  for (Index t = 0; t < mesh.triangles.rows(); ++t) {
    bool on_surface = true;
    for (int c = 0; c < 3; ++c) on_surface = on_surface && std::abs(values[mesh.triangles(t, c)]) <= most;
    if (!on_surface) continue;
    kept.push_back(t);
    for (int c = 0; c < 3; ++c) {
      std::int32_t& own = number[mesh.triangles(t, c)];
      if (own >= 0) continue;
      own = static_cast<std::int32_t>(used.size());
      used.push_back(mesh.triangles(t, c));
    }
  }
  if (static_cast<Index>(kept.size()) == mesh.triangles.rows()) return false;
  mesh.triangles = Triangles(mesh.triangles(kept, Eigen::all));
  mesh.vertices = Points(mesh.vertices(used, Eigen::all));
  for (Index t = 0; t < mesh.triangles.rows(); ++t)
    for (int c = 0; c < 3; ++c) mesh.triangles(t, c) = number[mesh.triangles(t, c)];
  return true;
}

/// Looks for thin parts and, where they are to be refined, or have come apart and the look is cheap, cuts the
/// cells there up.
void hold_together(const SparseGrid& grid, const TricubicSurrogate* model, bool refine, TriangleMesh& mesh,
                   ExtractionReport& report, EvaluationCounter& function) {
  const ThinCells thin = thin_cells(grid);
  report.pieces = piece_count(mesh);
  report.thin_cells = static_cast<Index>(thin.cells.size());
  const bool cheap = points_a_thin_cell * report.thin_cells <= function.value_count();
  if (thin.cells.empty() || !(refine || (report.pieces > 1 && cheap))) return;
  const std::optional<double> known = function.gradient_bound();
  const double slope = model != nullptr ? model->lipschitz() : known ? *known : measure_lipschitz(function);
  std::optional<HeldParts> held = hold_thin_parts(
      grid, thin, report.pieces, refine ? finest_refined : finest_resolution, slope, function);
  if (!held) return;
  const int resolution = held->factor * (grid.resolution() - 1) + 1;
  if (refine) {
    report.pieces = held->pieces;
    report.refinement = held->factor;
    mesh = std::move(held->mesh);
  } else if (held->pieces < report.pieces) {
    report.holding_resolution = resolution;
    report.notes.push_back("parts are thinner than two cells of the grid: the surface came apart into " +
                           std::to_string(report.pieces) + " pieces; resolution " +
                           std::to_string(resolution) + ", or refine_thin at this one, holds it in " +
                           std::to_string(held->pieces));
  }
}

}  // namespace

TriangleMesh extract_surface(const ImplicitFunction& implicit, const ExtractionOptions& options,
                             const Progress& progress, ExtractionReport* report) {
  options.validate();
  const int resolution = options.resolution;
  const auto start = std::chrono::steady_clock::now();
  progress.report(0.0, "finding the surface");
  EvaluationCounter function(implicit, progress);
  std::optional<TricubicSurrogate> model;
  if (resolution >= smallest_with_model)
    model.emplace(function, model_options(resolution, implicit.gradient_bound().has_value()));
  progress.report(0.4, "evaluating the grid");
  SparseGrid grid(resolution, model ? &*model : nullptr);
  grid.refine(function);
  progress.report(0.9, "marching cubes");
  TriangleMesh mesh = marching_cubes(grid, progress);
  require(mesh.triangles.rows() > 0, "sdf",
          "its values have one sign on the whole grid of " + std::to_string(resolution) + " points a side",
          "a function with a zero surface inside the cube [-1, 1]^3 is needed");
  ExtractionReport done;
  if (implicit.continuous()) {
    hold_together(grid, model ? &*model : nullptr, options.refine_thin, mesh, done, function);
    done.open = (mesh.vertices.array().abs() == 1.0).any();
  } else {
    done.open = (mesh.vertices.array().abs() == 1.0).any();
    const double bound = model ? model->lipschitz() : implicit.gradient_bound().value_or(1.0);
    done.open = drop_jumps(function, 0.5 * bound * 2.0 / (resolution - 1), mesh) || done.open;
    require(mesh.triangles.rows() > 0, "sdf", "its sign changes by jumps alone",
            "a function with a zero surface inside the cube [-1, 1]^3 is needed");
    done.pieces = piece_count(mesh);
  }
  mesh.vertices = implicit.frame().to_mesh(mesh.vertices);
  done.evaluations = function.value_count() + function.gradient_count();
  done.dense_evaluations = static_cast<Index>(resolution) * resolution * resolution;
  done.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (report != nullptr) *report = std::move(done);
  progress.report(1.0, "extracted the surface");
  return mesh;
}

}  // namespace arapfields
