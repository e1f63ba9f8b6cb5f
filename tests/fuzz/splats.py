# SPDX-License-Identifier: GPL-3.0-or-later
"""Valid calls of functions of Gaussian splats."""

import numpy as np

import arapfields as af

from .odd import ROWS, by_name

PLAIN = (ROWS, np.tile([1.0, 0, 0, 0], (len(ROWS), 1)), np.full((len(ROWS), 3), 0.1))
GIVEN = [*PLAIN, np.full(len(ROWS), 0.9), np.zeros((len(ROWS), 4, 3))]
NUMBERS = (4 + 12, len(ROWS))  # numbers per splat that a motion changes


def splat_calls(things):
    """{name: (function, valid arguments)} of functions of splats."""
    splats = af.GaussianSplats(*GIVEN)
    return {
        "GaussianSplats": lambda: (af.GaussianSplats, list(GIVEN)),
        "GaussianSplats.save": lambda: (by_name(splats.save, "task"), ["/nonexistent/x", af.Task()]),
        "GaussianSplats.save_gltf": lambda: (
            by_name(splats.save_gltf, "task"),
            ["/nonexistent/x", "name", af.Task()],
        ),
        "GaussianSplats.transformed": lambda: (
            by_name(splats.transformed, "task"),
            [[[2, 0, 0, 1], [0, 3, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], af.Task()],
        ),
        "GaussianSplats.load": lambda: (by_name(af.GaussianSplats.load, "task"), ["/nonexistent", af.Task()]),
        "GaussianSplats.is_file": lambda: (af.GaussianSplats.is_file, ["/nonexistent"]),
        "DeformationField.apply_to": lambda: (
            by_name(things["field"].apply_to, "max_stretch", "task"),
            [splats, 2.0, af.Task()],
        ),
        "PreparedSplats": lambda: (af.PreparedSplats, [splats]),
        "PreparedSplats.moved": lambda: (
            by_name(af.PreparedSplats(splats).moved, "max_stretch", "task"),
            [things["field"], af.GaussianSplats(*GIVEN), 2.0, af.Task()],
        ),
        "PreparedSplats.changes": lambda: (
            by_name(af.PreparedSplats(splats).changes, "task"),
            [things["field"], [*np.ones(NUMBERS, "f4")], [*np.ones(NUMBERS, "f4")], af.Task()],
        ),
        "sample_splats": lambda: (by_name(af.sample_splats, "task"), [splats, 30, af.Task()]),
    }
