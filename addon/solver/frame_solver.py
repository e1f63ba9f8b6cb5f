# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver of live mode, bakes and exports: a request in, a shape out."""

from dataclasses import dataclass, field, replace

import numpy as np

from ..blender.property_definitions import options_of
from ..core.errors import UserError
from ..core.geometry.edges import Topology
from ..core.runtime import native
from ..core.settings.parameters import presets
from ..handles.native_handles import native_handles
from ..surface.source_surface import PointsBefore
from .contact import native_contact
from .request import Request
from .setup import at_samples
from .stylization import stylization

REST_STEPS, FINE_TOLERANCE = 400, 1e-6  # of a solve from rest: to convergence
STYLE = presets("live").get("STYLE")  # preset for styles: label, tip, options
LEAST_RIGIDITY = 1e-3  # of a style
TRACKED = 2000  # about as many splats are tracked
TOUCHED = 2000  # about as many points are tested for contact
TOUCH = 5e-3  # distance from an obstacle's margin that counts as contact, in cube units


@dataclass(frozen=True)
class Shape:
    """The result of a request, in local coordinates, single precision."""

    points: np.ndarray  # (n, 3)
    rest: np.ndarray | None  # (n, 3) the source's points without the field; None for implicit surfaces
    turns: np.ndarray | None = None  # (n, 3) rotation vectors (axis · angle), for free custom normals
    changes: dict | None = None  # the splats' changed attributes
    touching: np.ndarray | None = None  # (k, 3) contact points, among a subset of the points
    topology: Topology | None = None
    carried: list = field(default_factory=list)  # what Carrying.moved made
    of: Request | None = None  # the request, if solved from rest; None for intermediate shapes


class FrameSolver:
    """Turns requests into shapes; not thread-safe: each thread needs a `clone`.

    `sampled` is a setup.SampledSource. A solve starts from the last shape, unless it begins at rest.
    """

    def __init__(self, sampled, carrying, handles=None, energy=None):
        setup = sampled.setup
        self.sampled, self.carrying = sampled, carrying
        self.solver = None
        handles = setup.handles if handles is None else handles
        self.set_points(setup.surface.local)
        self._make_solver(handles, setup.energy if energy is None else energy)

    shows_touch = False  # whether shapes have contact points

    def clone(self):
        """The same with a native solver of its own, for another thread."""
        return FrameSolver(self.sampled, self.carrying, self.handles, self.energy)

    def reuse(self, setup, carrying):
        """This solver for another setup with the same surface and energy, read anew."""
        masses = at_samples(setup, setup.masses, self.sampled.samples)
        self.sampled, self.carrying = replace(self.sampled, setup=setup, masses=masses), carrying
        self.set_points(setup.surface.local)
        return self

    def set_points(self, points):
        """(n, 3) points of the source that the field moves, in local coordinates."""
        self.before = PointsBefore(self.sampled.setup.surface, points)
        self._single = np.asarray(points, dtype=np.float32)

    @property
    def rest(self):
        """(n, 3) points at which the field is evaluated, in solve space."""
        is_of_source = self.sampled.topology is None
        return self.sampled.setup.surface.vertices if is_of_source else self.sampled.rest

    @property
    def rest_triangles(self):
        """(m, 3) triangles whose vertices `rest` are, by which touching parts are told apart, or None."""
        return self.sampled.setup.surface.faces if self.sampled.topology is None else None

    def _make_solver(self, handles, energy):
        """Makes the native solver for these handles and energy weights; its field starts at rest."""
        af, options, setup = native.library(), {**energy}, self.sampled.setup
        if setup.kind == "STYLIZE":
            options |= STYLE[2]
            # The native energy has stretch and bend with weight 1: all others are relative to it.
            rigidity = max(options.pop("rigidity"), LEAST_RIGIDITY)
            options["gauss_weight"] = af.LiveOptions().gauss_weight
            options["locality"] = 0.0  # as stylize()
            for name in ("barrier", "gauss_weight", "keep_stance", "handle_weight"):
                options[name] /= rigidity
        options["interior"] = setup.kind == "DEFORM" or bool(handles)  # a style alone acts everywhere alike
        held = self._native_handles(handles)
        self.solver = af.LiveDeformer(self.sampled.samples, held, options_of("live", options, setup.machine))
        self._track()
        self.handles, self.energy, self.style_key, self.motion = handles, energy, None, None
        self.contact_key, self.distances = None, {}  # {key of a Solid: MeshSdf}

    @property
    def moves_splats(self):
        surface = self.sampled.setup.surface
        return surface.splats is not None and surface.in_place

    def _track(self):
        """Tracks the points to measure their motion; of splats only some, as the field itself moves them."""
        every = max(1, len(self.rest) // TRACKED) if self.moves_splats else 1
        self.solver.track(self.rest[::every], triangles=self.rest_triangles)

    def _native_handles(self, handles):
        setup, af = self.sampled.setup, native.library()
        held = native_handles(af, handles, setup.surface, self.sampled.samples, setup.kind == "DEFORM")
        self.handle_count = len(held)
        return held

    def apply_request(self, request, task=None):
        """Passes a request to the native solver, except the handles' targets, which are returned."""
        if request.points is not self.before.local and self.sampled.topology is None:
            self.set_points(request.points)
        if request.energy != self.energy:
            self._make_solver(request.handles, request.energy)
        if request.handles is not self.handles:
            self.solver.set_handles(self._native_handles(request.handles))
            self.handles = request.handles
        if request.style is not None and request.style.key != self.style_key:
            self.style_key, directions, strength, sharpness, up = request.style
            weights = self.sampled.region
            self.solver.set_style(directions, strength, sharpness=sharpness, weights=weights, up=up)
        if request.contact_key != self.contact_key:
            self.solver.set_contact(native_contact(request.contact, self.distances), task=task)
            self.contact_key = request.contact_key
        if request.motion != self.motion:
            self._set_motion(request.motion, task)
            self.motion = request.motion
        # The last target belongs to the handle of the region far from all pins, which may be missing.
        return request.targets[: self.handle_count] if request.handles else None

    def _set_motion(self, motion, task):
        if motion is None:
            self.solver.set_secondary_motion(None)
            return
        options = options_of("secondary", dict(motion.options), self.sampled.setup.machine)
        further = {"masses": self.sampled.masses, "up": motion.up, "ground": motion.ground}
        self.solver.set_secondary_motion(options, **further, task=task)

    def follow(self, request, task=None, **options):
        """Iterates towards a request from the last shape; returns the number of iterations."""
        return self.solver.follow(self.apply_request(request, task), task=task, **options)

    def step(self, request, seconds, earlier, state=None, task=None):
        """Integrates secondary motion over `seconds`; `earlier` is the motion of the last request.

        `state`: native state to start from, instead of that after the last step.
        """
        targets = self.apply_request(request, task)
        if state is not None:
            self.solver.motion_state = state
        coordinates = request.motion.coordinates_since(earlier)
        self.solver.step(targets, seconds, coordinates=coordinates, task=task)

    def solve_from_rest(self, request, task=None):
        """The request's shape, independent of earlier solves: the same bits on any thread."""
        self.apply_request(request, task)  # before reset(): obstacles then start in place
        if request.style is not None and request.motion is None:
            return replace(self._stylized_shape(request, task), of=request)
        self.solver.reset()
        self.follow(request, iterations=REST_STEPS, tolerance=FINE_TOLERANCE, task=task)
        return replace(self.exact_shape(request), of=request)

    def _stylized_shape(self, request, task):
        """The request's shape as Stylize has it."""
        setup, topology = self.sampled.setup, self.sampled.topology
        weights = {name: weight for name, weight in request.energy.items() if name != "handle_weight"}
        values = {**weights, "strength": request.style.strength, "sharpness": request.style.sharpness}
        handles = [moved_to(handle, at) for handle, at in zip(request.handles, request.targets, strict=True)]
        _, directions, *_, up = request.style
        further = handles, setup.region, request.contact, setup.machine
        styled = stylization(values, directions, up, *further)
        field = styled.field(setup.surface, self.sampled.samples, task, self.distances)
        moved = field(self.rest, triangles=self.rest_triangles)
        triangles = self.rest_triangles if topology is None else topology.corners
        finished = styled.finished(setup.surface, self.rest, triangles, moved, task, self.distances)
        return self._shape(request, finished, field)

    def tracked_shape(self, request):
        """The request's shape as the solver tracks it, in single precision."""
        return self._shape(request, None if self.moves_splats else self.solver.tracked())

    def exact_shape(self, request):
        """The request's shape, evaluated from the field."""
        return self._shape(request, self.solver.field(self.rest, triangles=self.rest_triangles))

    def _shape(self, request, solved, field=None):
        """`field`: by default the solver's, made where something needs it."""
        surface, topology = self.sampled.setup.surface, self.sampled.topology
        needs_field = request.carried or surface.has_free_normals or surface.splats is not None
        needs_field = needs_field or self.before.needs_field
        moved = (self.solver.field if field is None else field) if needs_field else None
        further = {"before": self.before} if topology is None else {}
        samples = self.sampled.samples
        carried = self.carrying.moved(native.library(), samples, moved, request.carried, **further)
        if topology is not None:
            return Shape(self.to_local(solved), None, topology=topology, carried=carried)
        turns = surface.turns(moved, self.rest) if surface.in_place else None
        centers, changes = surface.splat_changes(moved) if surface.in_place else (None, None)
        solved = centers if solved is None else solved
        solved = self.before.moved(solved, moved)
        touching = self._touching(request, solved) if self.shows_touch else None
        # What does not move stays bit for bit.
        local = surface.space.moved_to_local(require_finite(solved), self.before.now, self.before.local)
        return Shape(in_single(local), self._single, turns, changes, touching, carried=carried)

    def _touching(self, request, solved):
        """(k, 3) points, of a subset, that touch the request's obstacles or ground, in local coordinates."""
        if request.contact is None:
            return None
        some = np.asarray(solved[:: max(1, len(solved) // TOUCHED)], dtype=np.float64)
        near = TOUCH * self.sampled.samples.frame.scale
        return self.to_local(some[request.contact.touched(self.distances, some, near)])

    def to_local(self, points):
        """(n, 3) from solve space to local coordinates, in single precision."""
        return in_single(self.sampled.setup.surface.space.to_local(require_finite(points)))


def moved_to(handle, target):
    """A handle at another target: (4, 4), or (3,) for a point."""
    if handle.kind == "POINT":
        place, target = target, handle.rest.copy()
        target[:3, 3] = place
    return replace(handle, target=target)


def require_finite(points):
    if not np.isfinite(points).all():
        raise UserError("The shape has vertices at invalid locations; move the handles less far")
    return points


def in_single(points):
    return np.ascontiguousarray(points, dtype=np.float32)
