# SPDX-License-Identifier: GPL-3.0-or-later
"""One source that is live: its solver, on a thread of its own, and the result that follows."""

import contextlib

import bpy
import numpy as np

from ..blender import mesh_arrays, vertex_groups
from ..blender.host import has_window
from ..blender.object_references import ObjectReference, settings_of
from ..blender.property_definitions import from_single_precision
from ..blender.user_preferences import machine_options
from ..core.errors import UserError
from ..core.geometry.spaces import space_of
from ..core.runtime import native
from ..core.runtime.coroutines import run_to_completion, step_for
from ..core.runtime.latest_request_worker import LatestRequestWorker
from ..core.runtime.progress import ProgressTracker
from ..core.settings.parameters import presets
from ..handles import empties
from ..handles.native_handles import native_handles
from ..results import result_objects
from ..stylize import preference
from ..surface.source_surface import read_surface, supported_options
from . import live_object

SAMPLES = 6000
PREVIEW_CELLS = 96  # at most, of the implicit surface that is shown while it moves
REFINEMENTS, STEPS_AT_ONCE, FINE_TOLERANCE = 40, 10, 1e-6
STYLE = presets("live").get("STYLE")  # label, tip, and options for a style, which acts everywhere


LEAST_RIGIDITY = 1e-3  # of a live style


class Changed(Exception):
    """The source was edited, or its handles or settings: the solver must be set up again."""


class Session:
    """Reads its source when made, on the main thread; everything that takes time is done by the worker."""

    def __init__(self, context, source, kind="DEFORM", shown=True, follow=True):
        settings = settings_of(source)
        self.source, self.kind, self.layout = ObjectReference(source), kind, layout_of(source, kind)
        self.surface = read_surface(context, source)
        self.fingerprint, self.may_be_edited = mesh_arrays.fingerprint(source.data), False
        self.output, self.choice = settings.output, settings.surface
        self.cells = min(settings.resolution, PREVIEW_CELLS)
        self.handles, self.weights = [], None
        self.energy = energy_weights(settings, kind)
        self.requested = self.solver = self.samples = self.topology = self.style_set = None
        self.result = None
        if shown:
            mesh = result_objects.shown_mesh(context, source, len(self.surface.local))
            self.result = ObjectReference(live_object.show(context, source, mesh))
        self.worker = None
        self.reading = self.read(context, follow)

    def read(self, context, follow=False):
        """Coroutine (core/coroutines.py) that reads the vertex groups; then the worker sets out."""
        source = self.source.get()
        style = settings_of(source).stylize if self.kind == "STYLIZE" else None
        names = preference.group_names(source, style) if style else empties.group_names(source)
        weights = yield from vertex_groups.read_weights(context, source, names)
        source = self.source.get()
        if style is None or settings_of(source).stylize.use_handles:
            self.handles = empties.solve_handles(source, self.surface.space, weights)
        if style is not None:
            style = settings_of(source).stylize
            self.weights = preference.region_weights(context, source, style, weights)
        if follow:
            self.worker = LatestRequestWorker(
                self.moved, self.prepare, self.refined, low_priority=has_window()
            )

    def advance(self):
        """Reads on for a moment; whether the worker has set out."""
        if self.worker is None:
            step_for(self.reading)
        return self.worker is not None

    def wait(self, seconds, refined):
        """Until the worker has reached the newest request, so many seconds at most."""
        if self.worker is None:
            run_to_completion(self.reading)
        self.look(bpy.context)
        self.worker.wait(seconds, refined)

    def stop(self):
        self.reading.close()
        if self.worker is not None:
            self.worker.stop()

    def prepare(self):
        """Sets the solver up; on the worker."""
        af, surface = native.library(), self.surface
        use_fit = self.output != "WARP" or self.choice == "FIT"
        use_fit = use_fit or (self.choice == "AUTO" and surface.is_cached)
        self.samples = surface.samples(ProgressTracker(af.Task), SAMPLES, 0, use_fit)
        options = {**self.energy}
        if self.kind == "STYLIZE":
            options |= STYLE[2]
            # The live energy has stretch with weight 1: all others are relative to it.
            rigidity = max(options.pop("rigidity"), LEAST_RIGIDITY)
            options["gauss_weight"] = af.LiveOptions().gauss_weight
            for name in ("bending", "barrier", "gauss_weight", "handle_weight"):
                options[name] /= rigidity
            if self.weights is not None:
                self.weights = vertex_groups.at_points(surface.vertices, self.weights, self.samples.points)
        handles = native_handles(af, self.handles, surface, self.samples)
        options["interior"] = bool(handles)  # a style alone acts everywhere alike
        options |= supported_options(af.LiveOptions, machine_options())
        self.solver = af.LiveDeformer(self.samples, handles, af.LiveOptions(**options))
        self.rest = surface.vertices
        if self.output != "WARP":
            self.rest, self.topology = surface.extract(ProgressTracker(af.Task), self.cells, 0.1)
        self.solver.track(self.rest)

    def moved(self, request):
        """(n, 3) vertices in local coordinates for this request, quickly; on the worker."""
        self.solve(request)
        return self.local(self.solver.tracked())

    def solve(self, request, **further):
        targets, style = request
        if style is not None and style[0] != self.style_set:
            directions, strength, sharpness = style[1:]
            self.solver.set_style(directions, strength, sharpness, self.weights)
            self.style_set = style[0]
        self.solver.solve(targets if self.handles else None, **further)

    def refined(self, request, token):
        """Better and better vertices, until the energy falls no more; on the worker."""
        for _ in range(REFINEMENTS):
            self.solve(request, iterations=STEPS_AT_ONCE, tolerance=FINE_TOLERANCE)
            if token.cancelled:
                return
            if self.solver.report["iterations"] < STEPS_AT_ONCE:
                break
            yield self.local(self.solver.tracked())
        yield self.local(self.solver.field(self.rest))

    def local(self, solved):
        if not np.isfinite(solved).all():
            raise UserError("the shape has vertices that are NaN or infinite; move the handles less far")
        return np.ascontiguousarray(self.surface.space.to_local(solved), dtype=np.float32)

    def look(self, context):
        """Sends what is asked for to the worker when it changed."""
        if not self.advance():
            return
        source, _ = self.source.get(), self.result.get()  # both are still there
        if source.mode == "EDIT":  # it goes on from what the user leaves
            return
        if layout_of(source, self.kind) != self.layout or self.is_edited(source):
            raise Changed
        request = self.current_request(context, source)
        if self.requested is None or not same(request, self.requested):
            self.requested = request
            self.worker.request(request)

    def is_edited(self, source):
        """Whether the source's mesh is another than when it was read; looked at after an update of it."""
        if not self.may_be_edited:
            return False
        self.may_be_edited = False
        return mesh_arrays.fingerprint(source.data) != self.fingerprint

    def current_request(self, context, source):
        """(targets of the handles, (key, directions, strength, sharpness) of the style or None)."""
        space, settings = space_of(source.matrix_world, source.name), settings_of(source).stylize
        targets = []
        if self.handles:
            current = empties.solve_handles(source, space)
            targets = [h.target[:3, 3] if h.kind == "POINT" else h.target for h in current]
        if self.kind != "STYLIZE":
            return targets, None
        style = preference.requested_style(settings, space)
        strength, sharpness = (
            from_single_precision(settings.strength),
            from_single_precision(settings.sharpness),
        )
        directions = style.directions(native.library())
        return targets, ((*style.key(), strength, sharpness), directions, strength, sharpness)

    def show(self):
        """Puts the newest shape on the result; True when there was one."""
        moved, error = self.worker.poll() if self.worker is not None else (None, "")
        if error:
            raise UserError(error)
        if moved is None:
            return False
        item = self.result.get()
        if item.mode == "EDIT":
            return False
        if len(item.data.vertices) != len(moved):
            if self.topology is None or len(moved) != len(self.rest):
                return False
            mesh_arrays.fill(item.data, moved, self.topology)
        mesh_arrays.set_positions(item.data, moved)
        return True

    def show_last(self):
        """What the worker made before it ended; an error of it no longer matters."""
        with contextlib.suppress(UserError, ReferenceError):
            self.show()


def energy_weights(settings, kind):
    """The weights of the energy's terms by name, as the section that is live has them."""
    group = settings.deform if kind == "DEFORM" else settings.stylize
    weights = {"bending": group.bending, "barrier": group.barrier}
    weights["handle_weight"] = settings.deform.handle_weight
    if kind == "STYLIZE":
        weights["rigidity"] = group.rigidity
    return {name: from_single_precision(value) for name, value in weights.items()}


def uses_handles(settings, kind):
    return kind == "DEFORM" or settings.stylize.use_handles


def layout_of(source, kind):
    """What the solver was set up for: the handles and their rest regions, and what is shown."""
    settings = settings_of(source)
    held = [(e.empty.session_uid, e.kind, e.group, e.weight, tuple(e.rest)) for e in empties.used(source)]
    style = settings.stylize.region, settings.stylize.region_material
    further = (*energy_weights(settings, kind).items(), settings.output, settings.surface)
    if kind == "STYLIZE":
        further += (*style, settings.stylize.use_handles)
    return (held if uses_handles(settings, kind) else [], further)


def same(a, b):
    """Whether two requests ask for the same."""
    if (a[1] and a[1][0]) != (b[1] and b[1][0]):
        return False
    return all(np.array_equal(x, y) for x, y in zip(a[0], b[0], strict=True))
