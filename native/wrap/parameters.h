// SPDX-License-Identifier: GPL-3.0-or-later
// Every constant of a wrap, with a sentence and its source each. "Tuned": chosen so that the published shapes
// of docs/performance.md, section Wrap, come closest to their targets with several seeds. Lengths and
// distances are shares of the diagonal of the target's bounding box unless a comment says otherwise.
#pragma once

#include <cmath>

#include "core/types.h"

namespace arapfields::wrap_parameters {

/// A parameter that changes geometrically from the first stage to the last.
struct Schedule {
  double first, last;
  /// t: 0 in the first stage, 1 in the last.
  double at(double t) const { return first * std::pow(last / first, t); }
};

// Stages of the flow: stiffness falls while correspondences gain weight, as in non-rigid ICP (Amberg,
// Romdhani, Vetter 2007, "Optimal Step Nonrigid ICP Algorithms for Surface Registration", section 4).

/// Weight of the mean squared distance between corresponding points; the last one times the option closeness.
constexpr Schedule correspondence_weight{10.0, 2000.0};  // tuned
/// Weight of ‖∇v J − (R − J)‖², the stretch that is left (docs/method.md).
constexpr Schedule rigidity{1.0, 0.1};  // tuned
/// Weight of ‖∇v‖², times the option bending: a viscous fluid (Christensen, Rabbitt, Miller 1996).
constexpr double viscosity = 1.5;  // tuned
/// Weight of tangential beside normal distances: between point-to-point (Besl, McKay 1992) and point-to-plane
/// (Chen, Medioni 1992, "Object Modelling by Registration of Multiple Range Images").
constexpr Schedule tangential_weight{0.3, 0.05};  // tuned
/// The same of coarse wraps that choose landmarks: one that slides less shows what contradicts it.
constexpr Schedule coarse_tangential_weight{0.3, 0.1};  // tuned
/// Weight of the distances from the target to the surface beside those from the surface, times the option
/// coverage: with both directions, all of the target is covered.
constexpr double coverage = 5.75;  // tuned
/// Weight in the last stage of correspondences without regard to normals; it grows with t². They draw in
/// parts that have no counterpart.
constexpr double unoriented_weight = 1.0;  // tuned
/// Weight of the mean squared distance of landmarks, times the option landmark_weight. It grows as that of
/// the correspondences does, which would pull landmarks off their places in the end.
constexpr Schedule landmark_weight{30.0, 3000.0};  // tuned
/// Radius of the radial functions: half of the target, then about the size of its details.
constexpr Schedule center_radius{0.5, 0.067};  // tuned
/// Number of centers in the first stage; the last has the option centers.
constexpr double first_centers = 60.0;  // tuned

// Correspondences: nearest points with compatible normals (Rusinkiewicz, Levoy 2001, "Efficient Variants of
// the ICP Algorithm", section 3.4).

/// Cosines of the angle between two normals: below the first a pair has weight 0, above the second weight 1.
constexpr double incompatible_cosine = -0.1, compatible_cosine = 0.5;  // tuned
/// On open targets a correspondence counts if its way back ends near its start: within so many spacings of
/// the target's samples, plus so many times its length (Pajdla, Van Gool 1995: iterative closest reciprocal
/// point).
constexpr double return_spacings = 1.5, return_share = 0.25;  // tuned

/// Weight of squared differences of curvature, in units of the usual one, in the last stage; it grows with t⁴
/// (Sharp, Lee, Wehe 2002, "ICP Registration Using Invariant Features"). Radius of its fits.
constexpr double curvature_weight = 0.03;   // tuned
constexpr double curvature_radius = 0.012;  // tuned

// One step of the flow.

/// Samples that the flow moves, and samples in a step's equations: for each center, at least, at most.
constexpr Index moved_samples = 9000, samples_a_center = 6, least_samples = 800, most_samples = 3000;
/// Candidates for each center, from which farthest-point sampling chooses.
constexpr Index candidates_a_center = 4;
/// Largest ‖∇v‖ of a motion; below 1 the motion y + v(y) is invertible (Vercauteren et al. 2009, section 2).
/// Beyond, it is split into so many motions at most, and then shortened.
constexpr double largest_gradient = 0.6;
constexpr int most_substeps = 4;
/// Weight of the squared coefficients (ridge regression), which keeps the equations well-conditioned.
constexpr double ridge = 1e-5;
/// Tikhonov term of the Cholesky factor, a share of the diagonal's mean; its growth, and the retries, where
/// rounding makes the matrix indefinite.
constexpr double regularization = 1e-9, regularization_growth = 100.0;
constexpr int regularization_retries = 4;

// Samples of both surfaces.

/// Samples of the target for the report, of these those that the flow uses, and of each for its curvature.
constexpr Index target_samples = 12000, flow_target_samples = 6000, curvature_samples = 48000;
/// Samples at which distances and det J, and at which energies, are measured for the report.
constexpr Index measured_samples = 20000, energy_samples = 4000;
/// Samples of which a flow tells the stretch.
constexpr Index stretch_samples = 1500;
/// Rest samples that the field keeps as starting points of its inverse.
constexpr Index kept_rest_points = 4000;
/// Neighbourhood of a target sample, in spacings: about twenty samples.
constexpr double neighbourhood_spacings = 2.5;
/// Angle, in radians, between consecutive directions to neighbours beyond which a sample lies at a border.
constexpr double border_gap = 2.4;  // π at a straight border; random samples inside rarely exceed it
/// Samples at which the mean spacing is measured.
constexpr Index spacing_samples = 200;

// Rigid alignment: ICP (Besl, McKay 1992, "A Method for Registration of 3-D Shapes") from many rotations.

/// Samples and rounds of the first pass over all rotations, and of the second over the best of them.
constexpr Index coarse_samples = 300, fine_samples = 1500;
constexpr int coarse_rounds = 6, fine_rounds = 30, finalists = 5;
/// Weight of landmarks in the pairs where there are fewer than three.
constexpr double landmark_share = 0.5;
/// A turn must leave less than this share of the error of the surface as it lies. One shape that lies
/// elsewhere leaves a fifth; of shapes that are not alike, nine tenths would stand on their heads or look
/// back for a gain of a tenth or two.
constexpr double turn_gain = 0.5;

// Checks of the input; all but the last are shares of a surface's own diagonal.

/// Distance at which a landmark is refused as off its surface.
constexpr double off_surface = 0.1;
/// Two landmarks closer than the first on one surface and farther than the second on the other contradict.
constexpr double same_point = 0.005, different_points = 0.1;
/// Mean landmark error that is worth a warning.
constexpr double poor_landmarks = 0.2;
/// Mean distance of aligned shapes above which they are reported as unlike.
constexpr double unlike_shapes = 0.035;

}  // namespace arapfields::wrap_parameters
