# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the fit, and its presets of quality."""

from .parameters import LAYERS, OCTAVES, SEED, WIDTH, Parameter

FIT = [
    Parameter(
        "steps", 400, "Steps", "Steps of the training; more is finer and takes longer", 1, 100000, 4000
    ),
    Parameter("seconds", 0.0, "Time Limit", "Seconds after which to stop; 0 for none", 0, 36000, 300),
    Parameter(
        "target_error",
        0.0,
        "Target Error",
        "Stop at this mean error near the surface, where the shape spans 1.5; 0 for never",
        0.0,
        1.0,
        0.01,
        advanced=True,
    ),
    Parameter(
        "batch", 1024, "Points per Step", "Points that each step learns from", 64, 65536, 8192, advanced=True
    ),
    Parameter(
        "near_points",
        150000,
        "Points near Surface",
        "Points near the surface that the network learns from",
        1000,
        10**7,
        10**6,
        advanced=True,
    ),
    WIDTH,
    LAYERS,
    OCTAVES,
    SEED,
]
QUALITIES = {  # of the fit: identifier → label, tip, what it sets
    "DRAFT": ("Draft", "Seconds: the overall shape", {"steps": 120, "width": 128, "octaves": 4}),
    "GOOD": ("Good", "For most shapes", {"steps": 400, "width": 256, "octaves": 4}),
    "FINE": ("Fine", "Minutes: small features too", {"steps": 2000, "width": 256, "octaves": 6}),
}
