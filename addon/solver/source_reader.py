# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads a source and its handles for a solver, on the main thread: the setup once, then requests."""

import functools
from dataclasses import replace

import numpy as np

from ..blender import evaluation, mesh_arrays, modifier_stack, user_preferences, vertex_groups
from ..blender.evaluation import depsgraph_of, is_animated
from ..blender.object_references import ObjectReference, settings_of
from ..blender.point_data import shape_keys_of
from ..blender.property_definitions import from_single_precision
from ..carried.carrying import Carrying, Reshaped
from ..core.errors import UserError
from ..core.geometry.spaces import space_of, unflattened
from ..core.runtime import native
from ..handles import empties, movers, symmetry
from ..handles.properties import UNKNOWN_FRAME
from ..surface.source_surface import read_surface
from . import secondary_motion, style_settings
from .contact import contact_of
from .frame_range import involved
from .frame_solver import Request, SolverSetup, StyleTerm, energy_weights

PREVIEW_CELLS = 96  # highest resolution of an implicit surface to move


class SourceChanged(UserError):
    """The source was edited, or its handles or settings: the solver must be set up again."""

    def __init__(self, name, reason=None):
        reason = reason or UserError("{name} changed while it was worked on; run again", name=name)
        super().__init__(reason.template, **reason.values)


class SourceReader:
    """Reads the surface in the constructor; `read_setup` reads the vertex groups, which may take a while.

    `in_place`: whether the mesh is read at the field modifier's place in the stack, not after all modifiers.
    """

    def __init__(self, context, source, kind, in_place):
        context.view_layer.update()
        self.reference, self.kind = ObjectReference(source), kind
        self.carrying = Carrying(context, source)
        space = solve_space(source, place_of(source), kind)
        self.surface, is_at_hand = read_at_rest(
            context, source, kind, in_place, carrying=self.carrying, space=space
        )
        self.moves_by_itself = in_place and has_motion_before(source, in_place)
        self.fingerprint = mesh_arrays.fingerprint(source.data)
        self.points = self.surface.local  # (n, 3) after the modifiers before the field
        self.handles, self.setup = [], None
        if not is_at_hand:
            self.read_points(context, source)

    def read_setup(self, context):
        """Coroutine (core/runtime/jobs.py) that reads the vertex groups, and makes `setup`."""
        in_place, names, weights = self.surface.in_place, None, {}
        while names != (now := self.group_names()):  # again where one is renamed meanwhile
            names = now
            weights = yield from vertex_groups.read_weights(context, self.reference.get(), names, in_place)
        source = self.reference.get()
        settings, soft, region, further = settings_of(source), secondary_motion.group_names(source), None, {}
        if self.kind == "DEFORM" or (uses_handles(settings, self.kind) and empties.used(source)):
            self.read_handles(source, weights)
        if self.kind == "STYLIZE":
            region = style_settings.region_weights(context, source, settings.stylize, weights, in_place)
            further = {"samples": settings.stylize.samples, "seed": settings.stylize.seed}  # as the operator
        self.setup = SolverSetup(
            kind=self.kind,
            surface=self.surface,
            cells=None if settings.output == "WARP" else min(settings.resolution, PREVIEW_CELLS),
            energy=energy_weights(settings, self.kind),
            machine=user_preferences.machine_options(),
            handles=self.handles,
            region=region,
            masses=weights[soft[0]] if soft else None,
            start=settings.secondary.start,
            fps=secondary_motion.frame_rate(context.scene),
            **further,
        )

    def group_names(self):
        """The vertex groups in use, by their present names."""
        source = self.reference.get()
        if self.kind == "STYLIZE":
            held = style_settings.group_names(source, settings_of(source).stylize)
        else:
            held = empties.group_names(source)
        return [*held, *secondary_motion.group_names(source)]

    def read_handles(self, source, weights=None):
        """Reads the handles at rest; `weights`: {vertex group: weights}, if any handle has one."""
        for entry in empties.used(source):
            movers.follow_rename(entry)
        handles = empties.solve_handles(source, self.surface.space, weights, place_of)
        self.handles = [replace(handle, target=handle.rest) for handle in handles]

    def read_points(self, context, source):
        """Reads the points after the modifiers before the field, where the field is evaluated."""
        points = points_now(context, source, self.surface)
        if not np.array_equal(points, self.points):
            self.points = points

    def refresh_carried(self, context):
        """Reads carried objects that may have been edited."""
        try:
            self.carrying.refresh(context)
        except Reshaped:
            raise SourceChanged(self.reference.name) from None

    def request(self, context, rendered=None):
        """The Request of the present handles and settings; `rendered`: read from a render's depsgraph."""
        source = seen = self.reference.get()
        if rendered is not None:
            seen = source.evaluated_get(rendered)
        where = functools.partial(place_of, rendered=rendered)
        settings, space, targets = settings_of(seen), space_of(where(source), source.name), []
        space = space.as_at(self.surface.space)
        if self.handles:
            current = empties.solve_handles(source, space, where=where, rendered=rendered)
            if len(current) != len(self.handles):
                raise SourceChanged(source.name)
            targets = [h.target[:3, 3] if h.kind == "POINT" else h.target for h in current]
        carried = self.carrying.poses(space, rendered or depsgraph_of(context))
        return Request(
            targets,
            style_term(settings.stylize, space, where) if self.kind == "STYLIZE" else None,
            self.points,
            self.handles,
            energy_weights(settings, self.kind),
            carried,
            secondary_motion.motion_of(settings, space),
            contact_of(source, settings, space, rendered or depsgraph_of(context)),
        )


def solve_space(source, world, kind):
    """The solve space of a source with that world matrix; a style ignores symmetry."""
    return symmetry.space_for(source, world) if kind == "DEFORM" else space_of(world, source.name)


def place_of(item, bone="", rendered=None):
    """(4, 4) world matrix of an object or its pose bone, from a render's depsgraph if given. An animated
    scale may be zero at some frames: full scale replaces it there."""
    matrix = empties.matrix_of(item if rendered is None else item.original.evaluated_get(rendered), bone)
    return unflattened(matrix) if item.type != "EMPTY" and not bone and is_animated(item) else matrix


def style_term(settings, space, where):
    style = style_settings.requested_style(settings, space, where=where)
    strength, sharpness = map(from_single_precision, (settings.strength, settings.sharpness))
    key, directions = (*style.key(), strength, sharpness), style.directions(native.library())
    return StyleTerm(key, directions, strength, sharpness, style.up)


def read_at_rest(context, source, kind, in_place, output=None, **further):
    """(the surface at rest, whether it is the current frame's). `further`: arguments of read_surface."""
    frame = rest_frame(source, kind, in_place, output)
    frame = None if frame == context.scene.frame_current else frame
    with evaluation.kept(context, [] if frame is None else involved(source, kind)):
        return read_surface(context, source, in_place, frame=frame, **further), frame is None


def points_now(context, source, surface):
    """(n, 3) points of a surface after the modifiers before the field, at the current frame."""
    with modifier_stack.evaluated_mesh(context, source, surface.in_place) as mesh:
        points = mesh_arrays.positions(mesh)
    if len(points) != len(surface.local):
        reason = UserError(
            "{name}: modifiers before the field make other numbers of vertices at other frames", source
        )
        has_modifiers = modifier_stack.shown_before(source, surface.in_place)
        raise SourceChanged(source.name, reason if has_modifiers else None)
    return points


def uses_handles(settings, kind):
    return kind == "DEFORM" or (kind == "STYLIZE" and settings.stylize.use_handles)


def rest_frame(source, kind, in_place, output=None):
    """The frame of the rest shape, for a surface that may move: the one at which its handles were placed.
    None if the current frame's shape is the rest shape. `output` overrides the object's setting."""
    settings = settings_of(source)
    if (
        (output or settings.output) != "WARP"
        or not uses_handles(settings, kind)
        or not has_motion_before(source, in_place)
    ):
        return None
    known = (entry.frame for entry in empties.used(source) if entry.frame != UNKNOWN_FRAME)
    return next(known, None)


def has_motion_before(source, in_place):
    """Whether modifiers before the field, or shape keys, may move the points without an edit of the mesh."""
    return bool(modifier_stack.shown_before(source, in_place) or shape_keys_of(source.data))
