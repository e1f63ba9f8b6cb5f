// SPDX-License-Identifier: GPL-3.0-or-later
// The constants of a wrap, with their sources. "Tuned": chosen so that the published shapes of
// docs/performance.md, section Wrap, come closest to their targets with several seeds. Lengths and distances
// are fractions of the diagonal of the target's bounding box unless a comment says otherwise.
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

// Stages of the flow: stiffness decreases while correspondences gain weight, as in non-rigid ICP (Amberg,
// Romdhani, Vetter 2007, "Optimal Step Nonrigid ICP Algorithms for Surface Registration", section 4).

/// Weight of the mean squared distance between corresponding points; the last one times the option closeness.
constexpr Schedule correspondence_weight{10.0, 2000.0};  // tuned
/// Weight of ‖∇v J − (R − J)‖², the linearised stretch after the step (docs/method.md).
constexpr Schedule rigidity{1.0, 0.1};  // tuned
/// Weight of ‖∇v‖², times the option bending: a viscous fluid (Christensen, Rabbitt, Miller 1996).
constexpr double viscosity = 1.5;  // tuned
/// Weight of tangential relative to normal distances: between point-to-point (Besl, McKay 1992) and
/// point-to-plane (Chen, Medioni 1992, "Object Modelling by Registration of Multiple Range Images").
constexpr Schedule tangential_weight{0.3, 0.05};  // tuned
/// The same for coarse wraps that choose landmarks: with less sliding, outliers are seen more clearly.
constexpr Schedule coarse_tangential_weight{0.3, 0.1};  // tuned
/// Weight of the distances from the target to the surface relative to those from the surface, times the
/// option coverage: with both directions, all of the target is covered.
constexpr double coverage = 5.75;  // tuned
/// Weight in the last stage of correspondences without regard to normals; it grows with t². They attract
/// parts without a counterpart to the target.
constexpr double unoriented_weight = 1.0;  // tuned
/// Weight of the mean squared distance of landmarks, times the option landmark_weight. It grows like that of
/// the correspondences, which would otherwise pull landmarks off their targets in the last stages.
constexpr Schedule landmark_weight{30.0, 3000.0};  // tuned
/// Radius of the radial functions: half of the target's size, then about that of its details.
constexpr Schedule center_radius{0.5, 0.067};  // tuned
/// Number of centers in the first stage; the last has the option centers.
constexpr double first_centers = 60.0;  // tuned

// Correspondences: nearest points with compatible normals (Rusinkiewicz, Levoy 2001, "Efficient Variants of
// the ICP Algorithm", section 3.4).

/// Cosines of the angle between two normals: below the first a pair has weight 0, above the second weight 1.
constexpr double incompatible_cosine = -0.1, compatible_cosine = 0.5;  // tuned
/// On open targets a correspondence must be reciprocal: the surface point closest to its target point lies
/// within so many spacings of the target's samples, plus so many times its length, of its start (Pajdla, Van
/// Gool 1995: iterative closest reciprocal point).
constexpr double return_spacings = 1.5, return_share = 0.25;  // tuned

/// Weight of squared differences of curvature, relative to their scale, in the last stage; it grows with t⁴
/// (Sharp, Lee, Wehe 2002, "ICP Registration Using Invariant Features"). Radius of its fits.
constexpr double curvature_weight = 0.03;   // tuned
constexpr double curvature_radius = 0.012;  // tuned

// One step of the flow.

/// Samples that the flow moves, and samples in a step's equations: for each center, at least, at most.
constexpr Index moved_samples = 9000, samples_a_center = 6, least_samples = 800, most_samples = 3000;
/// Candidates for each center, from which farthest-point sampling chooses.
constexpr Index candidates_a_center = 4;
/// Largest ‖∇v‖ of a motion; below 1 the motion y + v(y) is invertible (Vercauteren et al. 2009, section 2).
/// A larger one is split into at most so many motions, and then shortened.
constexpr double largest_gradient = 0.6;
constexpr int most_substeps = 4;
/// Weight of the squared coefficients (ridge regression), which keeps the equations well-conditioned.
constexpr double ridge = 1e-5;
/// Tikhonov term of the Cholesky factor, as a fraction of the diagonal's mean; the factor on it in each
/// retry, and the most retries, if rounding makes the matrix indefinite.
constexpr double regularization = 1e-9, regularization_growth = 100.0;
constexpr int regularization_retries = 4;

// Samples of both surfaces.

/// Samples of the target for the report, of these those that the flow uses, and of each for its curvature.
constexpr Index target_samples = 12000, flow_target_samples = 6000, curvature_samples = 48000;
/// Samples at which distances and det J, and at which energies, are measured for the report.
constexpr Index measured_samples = 20000, energy_samples = 4000;
/// Samples at which a flow measures the stretch.
constexpr Index stretch_samples = 1500;
/// Rest samples that the field keeps as starting points of its inverse.
constexpr Index kept_rest_points = 4000;
/// Neighbourhood of a target sample, in spacings: about twenty samples.
constexpr double neighbourhood_spacings = 2.5;
/// Angle, in radians, between consecutive directions to neighbours above which a sample is at a border.
constexpr double border_gap = 2.4;  // π at a straight border; random samples inside rarely exceed it
/// Samples at which the mean spacing is measured.
constexpr Index spacing_samples = 200;

// Rigid alignment: ICP (Besl, McKay 1992, "A Method for Registration of 3-D Shapes") from many rotations.

/// Samples and rounds of the first pass over all rotations, and of the second over the best of them.
constexpr Index coarse_samples = 300, fine_samples = 1500;
constexpr int coarse_rounds = 6, fine_rounds = 30, finalists = 5;
/// Weight of landmarks among the pairs if there are fewer than three.
constexpr double landmark_share = 0.5;
/// A rotated start must leave less than this fraction of the unrotated one's error. A rotated copy leaves a
/// fifth; nine tenths of the pairs of unlike shapes would be turned upside down or back to front for a gain
/// of a tenth or two.
constexpr double turn_gain = 0.5;

// Checks of the input; all but the last are fractions of a surface's own diagonal.

/// Distance at which a landmark is refused as off its surface.
constexpr double off_surface = 0.1;
/// Two landmarks closer than the first on one surface and farther than the second on the other contradict.
constexpr double same_point = 0.005, different_points = 0.1;
/// Mean landmark error that is worth a warning.
constexpr double poor_landmarks = 0.2;
/// Mean distance of aligned shapes above which they are reported as unlike.
constexpr double unlike_shapes = 0.035;

}  // namespace arapfields::wrap_parameters
