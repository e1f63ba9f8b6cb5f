# SPDX-License-Identifier: GPL-3.0-or-later
"""The input of a solver, read on the main thread, and the samples that a worker derives from it once."""

from dataclasses import dataclass

import numpy as np

from ..blender import vertex_groups
from ..blender.property_definitions import effective_values
from ..core.geometry.edges import Topology
from ..core.runtime import native
from ..core.runtime.jobs import ProgressTracker
from ..core.settings.choices import STYLIZE
from ..core.settings.parameters import DEFORM
from ..surface.source_surface import SourceSurface

SAMPLES = 6000
# Panel options that are weights of energy terms, and whether a style is finished on the mesh.
ENERGY = {
    "bending",
    "bending_unit",
    "barrier",
    "handle_weight",
    "symmetry",
    "rigidity",
    "keep_stance",
    "finish",
    "locality",
}


@dataclass(frozen=True)
class SolverSetup:
    """A source with its handles at rest; (n,) weights are those of the vertices, None for 1 everywhere."""

    kind: str  # DEFORM or STYLIZE
    surface: SourceSurface
    cells: int | None  # resolution of the implicit surface to move; None: the source's points are moved
    energy: dict  # weights of the energy's terms, by name
    machine: dict  # options that depend on the machine
    handles: list = ()
    region: np.ndarray | None = None  # weights with which a style acts
    masses: np.ndarray | None = None  # each vertex's share of secondary motion
    start: int = 1  # frame at which secondary motion begins
    fps: float = 24.0
    samples: int | None = None  # of the surface; None: SAMPLES
    seed: int = 0  # of their choice


@dataclass(frozen=True)
class SampledSource:
    """A setup's samples with their weights; several solvers may share it."""

    setup: SolverSetup
    samples: object
    region: np.ndarray | None  # weights of the samples
    masses: np.ndarray | None
    rest: np.ndarray | None = None  # (k, 3) vertices of the implicit surface, if that is moved
    topology: Topology | None = None


def sampled(setup, count=None, seed=None):
    """The SampledSource of a setup, of its own samples unless a count and a seed are given; on a worker."""
    count = count or setup.samples or SAMPLES
    seed = setup.seed if seed is None else seed
    surface, tracker = setup.surface, ProgressTracker(native.library().Task)
    moves_points = setup.cells is None
    samples = surface.samples(tracker, count, seed, own_triangles=surface.exact and moves_points)
    weights = [at_samples(setup, values, samples) for values in (setup.region, setup.masses)]
    if moves_points:
        return SampledSource(setup, samples, *weights)
    return SampledSource(setup, samples, *weights, *surface.extract(tracker, 0.1, resolution=setup.cells))


def at_samples(setup, weights, samples):
    """Vertex weights interpolated at the samples."""
    if weights is None:
        return None
    return vertex_groups.at_points(setup.surface.vertices, weights, samples.points)


def energy_weights(settings, kind):
    """The weights of the energy's terms by name, as the panel of that kind of solve has them."""
    shown, group = (DEFORM, settings.deform) if kind == "DEFORM" else (STYLIZE, settings.stylize)
    weights = effective_values([option for option in shown if option.name in ENERGY], group)
    held = [option for option in DEFORM if option.name == "handle_weight"]
    return weights | effective_values(held, settings.deform)
