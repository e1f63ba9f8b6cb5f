# SPDX-License-Identifier: GPL-3.0-or-later
"""What a live session's worker does: the solver is set up, then makes a shape for each request."""

import copy
from dataclasses import dataclass, field

import numpy as np

from ..blender import vertex_groups
from ..blender.native_options import options_of
from ..core.errors import UserError
from ..core.geometry.edges import Topology
from ..core.runtime import native
from ..core.runtime.progress import ProgressTracker
from ..core.settings.parameters import presets
from ..handles.native_handles import native_handles
from .swinging import Swinging

SAMPLES = 6000
# Quasi-Newton steps to the first shape of a request, and from there to the next. Each solve begins where the
# last one ended: after three the shape is behind by a quarter of what the handles moved since then.
FIRST_STEPS, FURTHER_STEPS = 3, 9
REFINEMENTS, STEPS_AT_ONCE, FINE_TOLERANCE = 40, 10, 1e-6
STYLE = presets("live").get("STYLE")  # label, tip, and options for a style, which acts everywhere
LEAST_RIGIDITY = 1e-3  # of a live style


@dataclass(frozen=True)
class Shape:
    """What the worker makes, in local coordinates, single precision."""

    points: np.ndarray  # (n, 3)
    rest: np.ndarray | None  # (n, 3) where the source's own points are without the field; None for surfaces
    turns: np.ndarray | None = None  # (n, 3) axis · angle, for free custom normals
    topology: Topology | None = None
    carried: list = field(default_factory=list)  # what Carrying.moved made


class Solving(Swinging):
    """Mixin of a session: all of this runs on its worker, or on another thread than the main one."""

    reached = None  # the request that the last shape was made for
    body = None  # the Body that the solver knows
    single = None  # the points that the solver moves, and these in single precision
    follows_animation = False  # whether what is asked for came with another frame, rather than by a drag

    def prepare(self):
        """Sets the solver up; on the worker."""
        af, surface = native.library(), self.surface
        ready = self.ready_solver()
        if ready is not None:
            self.samples, self.solver = ready
            self.bound, self.points, self.rest = (), surface.local, surface.vertices
            self.place_masses()
            return
        own_triangles = surface.exact and self.output == "WARP"
        self.samples = surface.samples(ProgressTracker(af.Task), SAMPLES, 0, own_triangles)
        self.place_masses()
        if self.kind == "STYLIZE" and self.weights is not None:
            self.weights = vertex_groups.at_points(surface.vertices, self.weights, self.samples.points)
        self.make_solver(self.handles, self.energy)
        if self.output != "WARP":
            self.rest, self.topology = surface.extract(ProgressTracker(af.Task), 0.1, resolution=self.cells)
            self.solver.track(self.rest)
        else:
            self.follow_points(surface.local)

    def make_solver(self, handles, energy):
        """A solver for these handles and weights of the energy's terms, which moves nothing yet."""
        af, options = native.library(), {**energy}
        if self.kind == "STYLIZE":
            options |= STYLE[2]
            # The live energy has stretch and bend with weight 1: all others are relative to it.
            rigidity = max(options.pop("rigidity"), LEAST_RIGIDITY)
            options["gauss_weight"] = af.LiveOptions().gauss_weight
            for name in ("barrier", "gauss_weight", "keep_stance", "handle_weight"):
                options[name] /= rigidity
        self.bound, self.energy, self.style_set, self.body = handles, energy, None, None
        held = self.native_handles(handles)
        options["interior"] = bool(held)  # a style alone acts everywhere alike
        self.solver = af.LiveDeformer(self.samples, held, options_of("live", options))
        if self.rest is not None:
            self.solver.track(self.rest)

    def native_handles(self, handles):
        reaches = self.kind == "DEFORM"
        return native_handles(native.library(), handles, self.surface, self.samples, reaches)

    def ready_solver(self):
        """(samples, solver) of this surface without handles, where one is set up; or None."""
        return None

    def follow_points(self, points):
        """Has the solver move these (n, 3) points of the source, in local coordinates; on the worker."""
        if points is not self.points and self.topology is None:
            self.points, self.rest = points, self.surface.space.to_solve(points)
            self.solver.track(self.rest)

    def moved(self, request):
        """Yields a shape for this request, quickly, and then a better one; on the worker."""
        if request.body is not None:
            self.swing(request)
            self.reached = request
            yield self.shape(self.solver.tracked())
            return
        for steps in (FIRST_STEPS, FURTHER_STEPS):
            taken = self.solve(request, iterations=steps)
            shape, self.reached = self.shape(self.solver.tracked()), request
            yield shape
            if taken < steps:
                break

    def twin(self):
        """The same with a solver of its own, for another thread; the samples and the surface are shared."""
        other = copy.copy(self)
        other.make_solver(self.bound, self.energy)
        return other

    def solve_from_rest(self, request, task=None):
        """The request's own shape, whatever was solved before it: the same bits on any thread."""
        self.solver.reset()
        steps = REFINEMENTS * STEPS_AT_ONCE
        self.solve(request, iterations=steps, tolerance=FINE_TOLERANCE, task=task)
        return self.shape(self.solver.field(self.rest))

    def aim(self, request):
        """Has the solver know all of the request but where its handles are; returns that."""
        targets, style, points, handles, energy, self.riding, body = request
        self.follow_points(points)
        if energy != self.energy:
            self.make_solver(handles, energy)
        if handles is not self.bound:
            self.solver.set_handles(self.native_handles(handles))
            self.bound = handles
        if style is not None and style[0] != self.style_set:
            directions, strength, sharpness, up = style[1:]
            self.solver.set_style(directions, strength, sharpness=sharpness, weights=self.weights, up=up)
            self.style_set = style[0]
        if body != self.body:
            self.set_body(body)
        return targets if handles else None

    def solve(self, request, **further):
        """Returns the steps that were taken."""
        return self.solver.follow(self.aim(request), **further)

    def refined(self, request, token):
        """Better and better shapes, until the energy falls no more; on the worker. None where another thread
        solves the frame from rest."""
        if self.follows_animation:
            return
        if request.body is not None:
            yield from self.settle(request, token)
            return
        for _ in range(REFINEMENTS):
            taken = self.solve(request, iterations=STEPS_AT_ONCE, tolerance=FINE_TOLERANCE)
            if token.cancelled:
                return
            if taken < STEPS_AT_ONCE:
                break
            yield self.shape(self.solver.tracked())
        yield self.shape(self.solver.field(self.rest))

    def shape(self, solved):
        field = self.solver.field if self.riding or self.surface.has_free_normals else None
        carried = self.carrying.moved(native.library(), self.samples, field, self.riding)
        if self.topology is not None:
            return Shape(self.local(solved), None, topology=self.topology, carried=carried)
        turns = self.surface.turns(field, self.rest) if self.surface.in_place else None
        if self.single is None or self.single[0] is not self.points:
            self.single = self.points, np.asarray(self.points, dtype=np.float32)
        return Shape(self.local(solved, still=True), self.single[1], turns, carried=carried)

    def local(self, solved, still=False):
        """(n, 3) in local coordinates; `still`: of the source's own, what does not move stays bit for bit."""
        if not np.isfinite(solved).all():
            raise UserError("the shape has vertices that are NaN or infinite; move the handles less far")
        space = self.surface.space
        local = space.moved_to_local(solved, self.rest, self.points) if still else space.to_local(solved)
        return np.ascontiguousarray(local, dtype=np.float32)
