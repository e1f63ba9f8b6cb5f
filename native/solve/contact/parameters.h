// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/types.h"

namespace arapfields {

/// Every constant of contact, with its unit and its reason. "Cube": half the shape's size is about 1.
/// "Spacing": the mean distance of neighbouring contact points.
struct ContactParameters {
  // Input
  /// Lengths in mesh units beyond which an obstacle is out of reach: where single precision ends.
  static constexpr double farthest_length = 1e38;
  /// Margins, heights of grounds and distances of obstacles (cube) beyond which places are imprecise.
  static constexpr double farthest_placed = 1e6;
  /// Relative error of a placement's uniform scale: that of matrices in single precision.
  static constexpr double scale_error = 1e-5;

  // Surfaces
  /// Distance (cube) at which sphere tracing reports a hit: well within the safety distance.
  static constexpr double hit_distance = 2e-4;
  /// Steps of sphere tracing: a segment that grazes a surface needs many.
  static constexpr int most_tracing_steps = 150;
  /// Least gradient norm of an implicit function as a divisor: fitted ones vanish at the medial axis.
  static constexpr double least_slope = 1e-3;

  // Points
  /// Contact samples: denser than any detail of a radial field.
  static constexpr Index most_samples = 14000;
  /// The random stream that chooses them: one of its own.
  static constexpr std::uint64_t sample_stream = 3;
  /// Cells (cube) by which the area, and so the spacing, is measured: finer than the shape, above a spacing.
  static constexpr double area_cell = 0.05;
  /// Mesh vertices farther than this (cube) from the samples' surface are points: nearer ones are within the
  /// safety distance.
  static constexpr double stands_out = 1e-3;
  /// Vertices that stand out: about a third of the samples, to bound the cost of a search.
  static constexpr Index most_vertices = 4000;
  /// Refined points: as many as the samples, to bound the cost of a search.
  static constexpr Index most_refined = 12000;
  /// Refined points for the area of one sample: their distance is less than the depth at an edge.
  static constexpr double refined_density = 12.0;
  /// Greatest distance (spacings) of a refined point from its sample: Voronoi cells of random samples.
  static constexpr double refined_reach = 2.2;
  /// Least cosine between the normals of neighbours on one side of the surface.
  static constexpr double neighbour_cosine = 0.5;
  /// How far beyond a sharp edge of the shape (spacings) a refined point may lie: rounding of the samples.
  static constexpr double beyond_edge = 0.05;
  /// Neighbours for the fit of a quadratic height field, which has three unknowns; with fewer it is flat.
  static constexpr Index least_fitted = 5;
  /// Regularisation of that fit, as a fraction of the matrix's trace: neighbours may lie on a line.
  static constexpr double fit_ridge = 1e-3;

  // Search
  /// Distance from a margin (cube) within which a point gets a plane: a round moves few points farther.
  static constexpr double search_distance = 0.04;
  /// The same in self-contact, where both sides move; and its upper bound, above which too many parts meet.
  static constexpr double search_distance_itself = 0.05, farthest_itself = 0.12;
  /// Distance (cube) that is kept beyond each margin: larger than the depth that solves leave.
  static constexpr double safety_distance = 1.5e-3;
  /// The same between parts: twice as much, since both sides are known at samples alone.
  static constexpr double safety_distance_itself = 2.0 * safety_distance;
  /// Gap below the safety distance (cube) within which parts do not touch each other: single precision.
  static constexpr double touching_gap = 2e-4;
  /// Tolerance (cube) of the test whether a path crosses a surface: one straight through a sheet is exactly
  /// as long as the distances at its ends together.
  static constexpr double path_error = 1e-4;
  /// Least cosine of the nearest normal with the one where the path entered, for both to be of one side: of a
  /// sheet, and of a solid, where sides that share an edge count as one.
  static constexpr double sheet_side_cosine = 0.3, solid_side_cosine = -0.5;
  /// Cosine of neighbouring planes' normals below which an obstacle has an edge between them.
  static constexpr double edge_cosine = 0.9;
  /// Distance (spacings) from an obstacle's edge within which it pokes through between samples.
  static constexpr double edge_distance = 2.0;

  // An obstacle that crosses the shape at the start
  /// Largest cosine of normals that count as opposite.
  static constexpr double opposite_cosine = -0.5;
  /// Largest distance of neighbours at rest (spacings): random samples have gaps of two.
  static constexpr double crossing_reach = 3.0;
  /// A patch is pushed out as a whole if its mean normal is at least this long (1: flat) ...
  static constexpr double one_sided = 0.5;
  /// ... and the cosines of the obstacle's normals with it are somewhere above the first and nowhere below
  /// the second, or so with both signs reversed.
  static constexpr double pushes_along = 0.7, pushes_against = -0.2;

  // The shape itself
  /// Least distance through the inside at rest (cube) of two samples in contact: basis functions are too wide
  /// to separate the sides of a crease or of the web between two fingers.
  static constexpr double far_inside = 0.15;
  /// Largest cosine of the normals of two samples that face each other.
  static constexpr double facing_cosine = -0.1;
  /// Largest distance (cube) at which gaps at rest are searched for: that of the search.
  static constexpr double gap_at_rest = 0.05;
  /// Depth (cube) that a solved shape may have where tracking starts at it.
  static constexpr double shallow = 0.01;
  /// Largest tangential offset of a pair (spacings): random samples have gaps of two.
  static constexpr double most_offset = 2.0;
  /// Samples at which the overlap test takes winding numbers: enough for a part as large as a finger.
  static constexpr Index most_probes = 500;
  /// Change of a winding number since rest that means "inside another part" or "pressed flat": 1 in theory.
  static constexpr double inside_another = 0.6;
  /// The same above a sample that has entered another part: less, as winding numbers are smoothed there.
  static constexpr double entered = 0.4;
  /// Winding number above a sample at rest from which it is inside another part: half of the jump.
  static constexpr double inside_at_rest = 0.5;
  /// Where parts intersect at rest, distance at rest (cube) within which two samples are excluded if one is
  /// near the other's plane or behind it: the interior embedding, a function of the place, cannot tell
  /// overlapping parts apart. Probes nearer to an intersection are left out.
  static constexpr double near_a_cut = 0.1;
  /// Offset between meshes in the search structure's coordinates: far from each other.
  static constexpr double meshes_apart = 10.0;
  /// Triangles are tested for crossings where their sample is within this (spacings) of another part.
  static constexpr double crossing_distance = 6.0;
  /// Triangles with a corner farther than this (spacings) from their sample are always tested.
  static constexpr double triangle_reach = 1.5;

  // Multipliers and friction
  /// Depth beyond a margin (cube) that counts as none.
  static constexpr double depth_tolerance = 5e-4;
  /// Least and largest stiffness (energy a unit of area and squared depth): below it depths stay visible,
  /// above it single precision ends.
  static constexpr double softest = 5e4, stiffest = 3e6;
  /// Factors of the stiffness where depths do not decrease, and where they do.
  static constexpr double stiffer = 4.0, softer = 0.25;
  /// Gap (cube) at which the mean pressure vanishes at most: the multiplier of a softer plane would hold off
  /// points farther away that have left it.
  static constexpr double hover = 2e-3;
  /// Depths (cube) are clamped to this in multiplier updates: early iterates penetrate by more than their
  /// forces warrant.
  static constexpr double deepest_counted = 0.01;
  /// Tangential displacement (cube) below which friction is quadratic (static) instead of linear.
  static constexpr double stuck = 2e-4;
  /// Softening length (cube) of the weights of forces near a handle: about the size of one.
  static constexpr double force_reach = 0.2;
  /// Least fold barrier while handles pull into contact: pressed parts would fold.
  static constexpr double fold_barrier = 10.0;

  // Line search
  /// Least curvature of the model of the other terms, as a fraction of −slope.
  static constexpr double least_curvature = 0.1;
  /// Iterations of its Newton method, and their tolerance on the step length.
  static constexpr int line_iterations = 8;
  static constexpr double line_tolerance = 1e-9;

  // The quadratic model, and the projection out of obstacles
  /// Springs of the preconditioner's update: the basis functions resolve no more.
  static constexpr Index most_springs = 240;
  /// Changes of the active set of complementarity, and Gauss–Seidel sweeps if it has not settled then.
  static constexpr int most_changes = 30, complementarity_sweeps = 200;
  /// Regularisation of its diagonal, as a fraction of the largest entry: near-parallel planes share a load.
  static constexpr double complementarity_ridge = 1e-4;
  /// Gauss–Seidel sweeps for the factors of the surfaces' pressures: a few unknowns.
  static constexpr int factor_sweeps = 20;
  /// Constraints that a projection adds in each of its rounds: dense matrices of their number squared.
  static constexpr Index planes_in_a_round = 60;
  static constexpr int projection_rounds = 5;
  /// Planes nearer at rest than the first (cube) whose normals' cosine is above the second count as one.
  static constexpr double planes_apart = 0.02, parallel_cosine = 0.9;
  /// A projection moves no point farther than this times the depth: beyond, the planes are incompatible.
  static constexpr double most_motion = 3.0;
  /// Tolerance of its gaps (cube): below that of depths.
  static constexpr double projection_gap = 1e-4;

  // Handles that give way
  /// Mean distance of a handle from its target (cube) above which it is reported as held back.
  static constexpr double held_back = 0.02;
  /// Root mean square distance (cube) of a handle that the shape itself holds back from its target: handles
  /// that are held back by different amounts would squash the shape between them.
  static constexpr double longest_pull = 0.01;
  /// Bounds in the quadratic program of a translation: no translation may fulfil more.
  static constexpr std::size_t most_bounds = 40;
  /// Its sweeps for each set of bounds, and its tolerance (cube).
  static constexpr int bound_sweeps = 200;
  static constexpr double bound_tolerance = 1e-6;
  /// A point is under a point handle if it is no farther from it than the first at rest, nor than the second
  /// perpendicular to the plane's normal now (widths of the shape there).
  static constexpr double under_pin = 1.5, aside_of_pin = 0.35;
  /// Searches for the thickest part near a point handle, which may lie at a thin edge.
  static constexpr int thickness_searches = 3;
  /// Motion of a handle (cube) below which its weight no longer grows.
  static constexpr double unmoved = 1e-3;
  /// Planes of curved solids are linearised anew at most so many times, until the translation changes by less
  /// than the tolerance (cube).
  static constexpr int most_linearisations = 6;
  static constexpr double linearisation_tolerance = 1e-4;
  /// Distance (cube) from a plane within which it is linearised anew: that of gaps at rest.
  static constexpr double linearised_distance = 0.05;

  // Continuation
  /// Longest motion of an obstacle in a step (cube): less than any part is thick.
  static constexpr double obstacle_step = 0.02;
  /// Steps towards targets. `length`, and `length_itself` with self-contact: longest motion of a target in a
  /// step (cube); `iterations` in each step but the last.
  struct Pace {
    double length;
    double length_itself;
    Index most_steps;
    Index iterations;
  };
  static constexpr Pace usual{0.15, 0.06, 24, 3};
  /// For a second try from the same start, where the usual steps may choose the wrong side.
  static constexpr Pace small{0.04, 0.03, 60, 10};
  /// Depth (cube) above which a step is rejected and halved, and how often: half a thin part.
  static constexpr double too_deep = 0.03;
  static constexpr int most_halvings = 4;
  /// Depth (cube) up to which the last projections push points out, and their number.
  static constexpr double projected_depth = 0.01;
  static constexpr int most_projections = 6;
  /// Iterations between two searches, and the fewest that a round is charged for.
  static constexpr Index round_iterations = 6, least_iterations = 2;
  /// Solves of at least so many iterations that take several steps run to convergence, so that rounding
  /// changes the result less: rounds of `long_round` iterations, until one moves no sample by more than
  /// `at_rest` (cube). Not with self-contact: handles that meet would block each other.
  static constexpr Index patient = 30, long_round = 20;
  static constexpr double at_rest = 1e-3;
  /// Rounds beyond the requested iterations while points penetrate.
  static constexpr Index more_rounds = 4;
  /// A depth decreases if a round leaves at most this fraction of it; otherwise the stiffness is raised.
  static constexpr double depth_left = 0.8;
  /// Relative change of the energy below the resolution of single precision.
  static constexpr double energy_floor = 1e-10;

  // Trials
  /// Iterations of a trial without contact that is to leave a poor local minimum.
  static constexpr Index trial_iterations = 60;
  /// Relative decrease of the energy with which its solution replaces the current one.
  static constexpr double better = 0.01;
  /// Solves that separate parts after a leap: the first one often leaves parts a little in each other.
  static constexpr int most_separations = 3;
  /// Steps with short pulls, where handles cannot reach their targets.
  static constexpr int most_pulls = 3;

  // A whole solve in contact (solve/radial/full_solve.h)
  /// It continues while a check finds the depth, or the distance of handles that are held back, reduced to
  /// less than these fractions.
  static constexpr double depth_gain = 0.8, distance_gain = 0.98;
  /// Increases of the energy that do not end it (planes that become active raise it), and checks at which the
  /// depth is above the tolerance without having fallen.
  static constexpr int most_rises = 6, most_stalled_checks = 3;
  /// Factor on the least gain while handles are held back, which would slide slowly for many iterations.
  static constexpr double gain_while_held = 10.0;
  /// Where handles are held back, a coarse solve goes on at most `most_slides` times, by so many solves of so
  /// many iterations, which each pull a short way, while their distance or the energy falls below a fraction.
  static constexpr int most_slides = 12, solves_a_slide = 5, iterations_a_slide = 4;
  static constexpr double slide_gain = 0.99;

  // Secondary motion
  /// Rounds of a time step, while points penetrate or the pressures' relative change is at least `unsettled`:
  /// those of the step before may hold the impulse of an impact, which would make a body bounce.
  static constexpr Index motion_rounds = 8;
  static constexpr double unsettled = 0.2;
  /// Depth (cube) that a time step may leave.
  static constexpr double motion_depth = 3.0 * depth_tolerance;
};

}  // namespace arapfields
