# SPDX-License-Identifier: GPL-3.0-or-later
"""Every tolerance of the tests by name, with its reason."""

# The network's jets and their pull-back in double precision against PyTorch's: rounding, amplified.
AUTOGRAD = 1e-8
# Central differences of eighth order with step 1e-3: truncation and rounding each below 1e-10 of the largest.
DIFFERENCES = 1e-8
# Single precision against double, relative to a column's largest entry: rounding times sharpness².
FLOAT_JETS = 2e-4
