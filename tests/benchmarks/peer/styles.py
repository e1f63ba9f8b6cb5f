# SPDX-License-Identifier: GPL-3.0-or-later
"""Styles of clean meshes beside gaussStylization's, of one strength and of the same energy."""

import time
from pathlib import Path

import numpy as np

import arapfields as af

from .. import shapes
from . import theirs, yardstick

OTHERS = ("spot", "bunny", "rockerArm")  # meshes of gaussStylization's checkout
COW = "common-3d-test-models"  # a checkout that has the cow; without it the cow is left out
CREATURES = ("dinosaur", "lizard")  # the dog has slivers, which gaussStylization does not take
STYLES = ("cube", "octahedron", "dodecahedron", "hexagonal prism")
LAMBDA = 4.0  # as in its own example
WEIGHTS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)  # of our finish, for the one of the same energy


def meshes(checkout):
    from support.geometry.meshes import read

    files = {name: checkout / "meshes" / f"{name}.obj" for name in OTHERS}
    if (cow := checkout.parent / COW / "data" / "cow.obj").is_file():
        files["cow"] = cow
    found = {name: read(Path(file))[:2] for name, file in files.items()}
    return found | {f"our {name}": shapes.own_mesh(name) for name in CREATURES}


def ours(vertices, triangles, style):
    """The field's vertices and the finished ones, and processor seconds of all."""
    begin = time.process_time()
    samples = af.sample_mesh(vertices, triangles)
    before = {"centers": af.CENTERS_BEFORE_SHARPEN, "iterations": af.ITERATIONS_BEFORE_SHARPEN}
    field = af.stylize(samples, style, af.StylizeOptions(**before))
    moved = field(vertices)
    return moved, af.sharpen(vertices, triangles, moved, style), time.process_time() - begin


def at_energy(energy, found):
    """The angle at an energy, from rows measured at several."""
    energies, angles = np.array(sorted((row["mesh_energy"], row["mean_angle"]) for row in found)).T
    if not energies[0] <= energy <= energies[-1]:
        return "not reached"
    return round(float(np.interp(energy, energies, angles)), 2)


def row(module, name, vertices, triangles, style):
    preferred = af.preferred_normals(style)

    def styled(moved):
        return yardstick.styled(vertices, triangles, moved, preferred)

    moved, seconds, _ = theirs.gauss(module, vertices, triangles, preferred, LAMBDA, "styles")
    field, finished, own_seconds = ours(vertices, triangles, style)
    own, is_finite = styled(finished), np.isfinite(moved).all()
    other = styled(moved) if is_finite else dict.fromkeys(own, "not finite")
    same = "not finite"
    if is_finite:
        options = [af.SharpenOptions(style_weight=weight) for weight in WEIGHTS]
        curve = [styled(af.sharpen(vertices, triangles, field, style, each)) for each in options]
        same = at_energy(other["mesh_energy"], curve)
    return {
        "what": f"Styles of meshes, gaussStylization at λ = {LAMBDA:g}",
        "by": f"{name}: {style}",
        "their_cpu_s": round(seconds, 2),
        "cpu_s": round(own_seconds, 2),
        "their_mesh_energy": other["mesh_energy"],
        "mesh_energy": own["mesh_energy"],
        "their_mean_angle": other["mean_angle"],
        "mean_angle": own["mean_angle"],
        "angle_at_their_energy": same,
        "folded_percent": own["folded_percent"],
    }


def rows(checkout):
    module = theirs.built_gauss(checkout)
    for name, (vertices, triangles) in meshes(checkout).items():
        size = np.ptp(vertices, axis=0).max()
        for style in STYLES:
            yield row(module, name, np.asarray(vertices, float) / size, np.asarray(triangles), style)
