# SPDX-License-Identifier: GPL-3.0-or-later
"""A style's solve from rest, and its finish on the mesh's vertices: of the operator, live mode and bakes."""

import math
from dataclasses import dataclass

import numpy as np

from ..blender import vertex_groups
from ..blender.property_definitions import options_of
from ..core.runtime import native
from ..core.settings.choices import STYLIZE
from ..core.settings.parameters import is_fast
from ..handles.native_handles import held_points, native_handles
from .contact import ContactTerm, native_contact


@dataclass(frozen=True)
class Stylization:
    """Made by stylization(), used on a worker."""

    directions: object  # (k, 3) preferred normals in solve space, or the ObjectStyle there
    up: np.ndarray  # (3,)
    options: object  # native StylizeOptions
    finish: object  # native SharpenOptions, or None
    handles: list  # core.geometry.handles.Handle; what they hold stays where the field has it
    region: np.ndarray | None  # (n,) weights of the source's vertices, with which the style acts
    contact: ContactTerm | None
    alone: bool  # whether the style alone moves the surface: strength is then the share of the whole way

    def field(self, surface, samples, task, distances=None):
        """The field. `distances`: {key of a Solid: MeshSdf} that is known, and added to."""
        af, weights = native.library(), self.region
        return af.stylize(
            samples,
            self.directions,
            self.options,
            weights=None if weights is None else at_points(surface, weights, samples.points),
            up=self.up,
            handles=native_handles(af, self.handles, surface, samples, reaches=False),
            contact=native_contact(self.contact, distances),
            task=task,
        )

    def finished(self, surface, points, triangles, moved, task, distances=None):
        """(k, 3) positions of `moved` points, of which `points` (k, 3) are those at rest, in solve space;
        `distances` as of field()."""
        if self.finish is None or triangles is None:
            return moved
        weights = self.region
        if weights is not None and points is not surface.vertices:
            weights = at_points(surface, weights, points)
        if self.handles:
            held = held_points(self.handles, surface, points)
            weights = np.where(held, 0.0, 1.0 if weights is None else weights)
        up = None if self.handles else self.up
        contact = native_contact(self.contact, distances)
        further = {"weights": weights, "up": up, "contact": contact, "alone": self.alone, "task": task}
        return native.library().sharpen(points, triangles, moved, self.directions, self.finish, **further)


def stylization(values, directions, up, handles, region, contact, machine=None):
    """The Stylization of settings by name; `machine` as of options_of()."""
    finish = None
    if values["finish"] and not (contact is not None and contact.itself):
        shared = {name: values[name] for name in ("strength", "sharpness", "rigidity")}
        finish = options_of("sharpen", shared, machine)
        af = native.library()
        iterations = min(values.get("iterations", math.inf), af.ITERATIONS_BEFORE_SHARPEN)
        values = values | {"centers": af.CENTERS_BEFORE_SHARPEN, "iterations": iterations}
    options = options_of("stylize", values, machine)
    is_radial = "field" not in values or is_fast(values, STYLIZE)  # live mode knows no other
    alone = is_radial and not handles
    return Stylization(directions, up, options, finish, handles, region, contact, alone)


def at_points(surface, weights, points):
    return vertex_groups.at_points(surface.vertices, weights, points)
