# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs a page's Python blocks in order in one namespace: run_blocks.py PAGE, in an empty folder.

Solves and fits are limited to a few steps: the code is run, the quality of results is not tested. For blocks
that import bpy, the extension is registered.
"""

import os
import sys
from pathlib import Path

import numpy as np
import pages

import arapfields as af

LIMITS = {
    "iterations": 12,
    "width": 64,
    "samples": 2000,
    "centers": 100,
    "poses": 16,
    "near_points": 20000,
    "uniform_points": 5000,
    "time_budget": 3.0,
}
FIT_ITERATIONS = 120  # with fewer there is no surface to sample
TAKE_OPTIONS = {  # functions whose third argument is options
    "fit_sdf": "FitOptions",
    "deform": "DeformOptions",
    "stylize": "StylizeOptions",
    "train_inverse": "InverseTrainingOptions",
    "skin_weights": "SkinOptions",
}


def shortened(kind):
    """A subclass of an options class with low limits of iterations."""

    def short(options):
        limits = LIMITS | ({"iterations": FIT_ITERATIONS} if kind.__name__ == "FitOptions" else {})
        for name, most in limits.items():
            if hasattr(options, name) and (getattr(options, name) > most or getattr(options, name) == 0):
                setattr(options, name, most)
        return options

    def make(**given):
        return short(kind(**given))

    if hasattr(kind, "preset"):
        make.preset = lambda name, **given: short(kind.preset(name, **given))
    return make


def with_short_options(call, position, make):
    def shortened_call(*arguments, **named):
        if len(arguments) <= position and "options" not in named:
            named["options"] = make()
        return call(*arguments, **named)

    return shortened_call


def shorten_library():
    for kind in [name for name in vars(af) if name.endswith("Options")]:
        setattr(af, kind, shortened(getattr(af, kind)))
    for call, kind in TAKE_OPTIONS.items():
        setattr(af, call, with_short_options(getattr(af, call), 2, getattr(af, kind)))


def readme_names():
    """Names that the README's code uses: a mesh, a box around each end, and the target of the second."""
    from support.geometry.meshes import sphere

    V, F = sphere(1.0, 3)
    box_a, box_b = np.diag([1.1, 1.1, 0.2, 1.0]), np.diag([1.1, 1.1, 0.2, 1.0])
    box_a[2, 3], box_b[2, 3] = -0.9, 0.9
    moved = box_b.copy()
    moved[2, 3] += 0.2
    return {"V": V, "F": F, "box_a": box_a, "box_b": box_b, "moved_box_b": moved}


def main(page):
    blocks = pages.python_blocks(page)
    if any("import bpy" in code for _, code in blocks):
        sys.path.insert(0, str(pages.ROOT))
        import bpy  # noqa: F401

        import addon

        addon.register()
    shorten_library()
    namespace = readme_names() if page.name == "README.md" else {}
    for line, code in blocks:
        exec(compile("\n" * (line - 1) + code, pages.name(page), "exec"), namespace)


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    main(Path(sys.argv[1]))
    sys.stdout.flush()
    os._exit(0)  # bpy 4.5 may deadlock at the end of the process
