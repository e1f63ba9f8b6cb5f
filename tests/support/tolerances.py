# SPDX-License-Identifier: GPL-3.0-or-later
"""Every tolerance of the tests by name, with its reason."""

# The network's jets and their pull-back in double precision against PyTorch's: rounding, amplified.
AUTOGRAD = 1e-8
# Central differences of eighth order with step 1e-3: truncation and rounding each below 1e-10 of the largest.
DIFFERENCES = 1e-8
# Single precision against double, relative to a column's largest entry: rounding times sharpness².
FLOAT_JETS = 2e-4
# Energies in float64 against another float64 formula of the same derivative: rounding, amplified by the
# conditioning of K, which the tests keep above 0.2.
FLOAT64_GRADIENT = 1e-8
# Closest rotations against singular values: 1e-16 over the smallest sum of two singular values (0.2).
FLOAT64_ROTATION = 1e-13
# The same energies in float32 (rounding 6e-8) after some hundred operations.
FLOAT32_ENERGY = 2e-5
# g(n_k) = 1: residual of the linear system after refinement.
GAUSS_WEIGHTS = 1e-10
# Distances against libigl's, as a share of the bounding box's diagonal: both are exact to rounding.
DISTANCE = 1e-12
# Share of points on the same side as libigl's. On closed meshes only points within rounding of the surface
# may differ; on open ones the boundary is where the winding number passes 1/2, which both approximate.
SIGN_AGREEMENT_CLOSED = 0.9999
SIGN_AGREEMENT_OPEN = 0.999
# Winding numbers against sums of solid angles: truncation of the multipole expansion.
WINDING = 1e-3
# Published networks in single precision against PyTorch in double.
PUBLISHED_VALUE = 1e-5
PUBLISHED_GRADIENT = 1e-4
# A fit's reported mean errors against means over other random points: sampling noise of some thousand points.
FIT_REPORT = 0.15
# A live solver at rest against the identity, in the unit cube: rounding times a hundred centers.
LIVE_IDENTITY = 1e-8
# A pose solved again after others, as a share of the shape's length: progress of the last steps.
LIVE_DRIFT = 1e-4
# Share of the minimised value by which rounding may raise it: the first steps are taken in single precision.
LIVE_ROUNDING = 1e-5
# Share of a drag's step by which shapes after three iterations may be behind: less than a frame's delay.
LIVE_KEEPS_UP = 0.5
# Energy at the end of a drag back over that of a direct solve of the pose: steps end at 2e-4 of it.
LIVE_WAY_BACK = 1.05
# Single-precision fields against differences of fourth order with step 2e-3: rounding over the step, and
# truncation where the encoding's highest octave bends most.
FLOAT_FIELD_DIFFERENCES = 1e-3
# Newton's inverse of a single-precision field: rounding of the field over its smallest stretch.
NEWTON_INVERSE = 1e-6
# Exact handles: rounding of single precision on lengths of order one.
EXACT_HANDLE = 1e-6
# Energies of a field and of the same field rotated: rounding of the rotation.
RIGID_INVARIANCE = 1e-10
# Slopes of whole losses: eighth-order differences with step 5e-3 of a function with kinks in its third
# derivative (barrier, fall-off), relative.
LOSS_GRADIENT = 1e-6
# Vertices of marching cubes against scikit-image's in the cube: rounding of float32 grids.
SAME_VERTICES = 1e-6
# |Φ| at samples of the surface, in cube units.
ON_SURFACE = 1e-4

TRACKED = 5e-4  # single precision; large coefficients of neighbouring centers of opposite sign cancel

# Energies composed of libtorch operations against the kernels, both in float64: rounding over the smallest
# sum of two singular values, which the tests keep above 1e-3.
COMPOSED = 1e-10
# Sixty steps of descent in single precision along the two: rounding, amplified by optimizers that turn small
# gradients into steps of full length. Seen: 1e-6 (orthogonal), 2e-4 (Adam), 6e-3 (exact handles).
COMPOSED_SOLVE = 0.02
# Singular values from 0.01 to 1 after Jordan's five polynomials: they end in [0.68, 1.21].
EVENED = 0.35
# Singular vectors after a step in double precision.
SAME_VECTORS = 1e-9
# A solve with products rounded to bfloat16 against one without: effect of a noise of 2e-3 in products.
ROUNDED_SOLVE = 0.1
# How many times as long a call may take beside as many busy processes as there are processors: fair is 2, the
# rest is the scheduling delay of threads that wait for each other.
BUSY_SLOWDOWN = 2.5
# The weighted terms of a loss against the loss: another order of the sum.
TERMS_OF_LOSS = 1e-9
# An energy in Python in double precision against the kernel in single precision, relative to the loss.
ENERGY_IN_PYTHON = 1e-4
# Central differences over 1e-3 of the cube, against the exact gradient of a smooth function.
FUNCTION_DIFFERENCES = 1e-5
# Vertices of an analytic sphere's extraction: values in single precision, linear between grid points.
SPHERE_EXTRACTION = 2e-3
