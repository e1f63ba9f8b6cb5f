# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the fit, and its presets of quality."""

from .parameters import parameters, presets

FIT = parameters("fit")
QUALITIES = presets("fit")  # identifier → label, tip, what it sets
