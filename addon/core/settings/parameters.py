# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings that artists see: names of the native options, labels, explanations, ranges."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Parameter:
    """One setting. `name` is the native option's; `default` decides the type (bool, int, float, str)."""

    name: str
    default: object
    label: str
    tip: str
    low: float | None = None
    high: float | None = None
    soft_high: float | None = None
    items: tuple = ()  # (identifier, label, tip) of a choice
    advanced: bool = False


SEED = Parameter(
    "seed", 0, "Seed", "Same seed, same settings: the same result", 0, 2**31 - 1, 100, advanced=True
)
TIME = Parameter(
    "time_budget",
    0.0,
    "Time Limit",
    "Seconds after which to stop with what was reached; 0 for none",
    0,
    36000,
    300,
)
WIDTH = Parameter(
    "width",
    256,
    "Network Width",
    "Units of each layer; more can bend more finely, and take longer",
    8,
    1024,
    512,
    advanced=True,
)
LAYERS = Parameter("layers", 4, "Network Layers", "Hidden layers of the network", 1, 16, 8, advanced=True)
LEARNING_RATE = Parameter(
    "learning_rate",
    0.0,
    "Learning Rate",
    "Size of the steps of the solve; 0 for what suits most shapes",
    0.0,
    0.1,
    0.05,
    advanced=True,
)
OCTAVES = Parameter(
    "octaves",
    4,
    "Detail Octaves",
    "Octaves of detail of the network's input; more can follow smaller features",
    0,
    12,
    8,
    advanced=True,
)

SAMPLES = Parameter(
    "samples",
    20000,
    "Samples",
    "Points spread evenly over the surface at which its rigidity is judged",
    100,
    1000000,
    100000,
)
BENDING = Parameter(
    "bending",
    0.01,
    "Stiffness",
    "Resistance to bending, against stretching: low gives sharp joints, high gives wide, soft bends",
    0.0,
    10.0,
    0.1,
)
BARRIER = Parameter(
    "barrier",
    0.0,
    "Fold Barrier",
    "Keeps the surface from folding through itself locally; 0 for off",
    0.0,
    1000.0,
    1.0,
    advanced=True,
)

DEFORM = [
    Parameter(
        "field",
        "neural",
        "Method",
        "How the motion is represented",
        items=(
            ("neural", "Neural", "A small network trained for this pose: the best quality"),
            ("radial", "Fast", "Smooth bumps solved directly: interactive, slightly softer"),
        ),
    ),
    Parameter(
        "iterations", 300, "Iterations", "Steps of the solve; more is finer and takes longer", 1, 100000, 1000
    ),
    BENDING,
    Parameter(
        "handle_weight",
        100.0,
        "Handle Weight",
        "How strictly the handles are followed, against rigidity",
        0.01,
        1e6,
        1000.0,
    ),
    Parameter(
        "exact_handles",
        False,
        "Exact Handles",
        "What lies in a handle's box follows it exactly instead of nearly",
    ),
    Parameter(
        "margin",
        0.1,
        "Fall-off",
        "Width of the blend around exact handles, relative to the shape's half size",
        0.001,
        1.0,
        0.5,
        advanced=True,
    ),
    TIME,
    SAMPLES,
    Parameter(
        "batch", 300, "Samples per Step", "Samples that each step looks at", 16, 100000, 4000, advanced=True
    ),
    Parameter(
        "start",
        "identity",
        "Start",
        "What the network starts from",
        items=(
            ("identity", "Rest Shape", "The shape as it is"),
            ("radial", "Fast Result", "The result of the fast method, which the network then refines"),
        ),
        advanced=True,
    ),
    BARRIER,
    Parameter(
        "invertibility",
        0.0,
        "Invertibility",
        "Weight of a second network that undoes the motion, which keeps the space from folding; 0 for off",
        0.0,
        1000.0,
        10.0,
        advanced=True,
    ),
    LEARNING_RATE,
    WIDTH,
    LAYERS,
    OCTAVES,
    SEED,
]

OURS = {"samples"}  # settings of the add-on that are no native option


def native_options(values):
    """The settings that the native options know, as keyword arguments."""
    return {name: value for name, value in values.items() if name not in OURS}
