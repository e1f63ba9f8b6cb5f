# SPDX-License-Identifier: GPL-3.0-or-later
"""Requests, and the solver, set up once, that turns each into a shape from rest, deformed or stylized."""

import hashlib
import math
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import NamedTuple

import numpy as np

from ..blender import vertex_groups
from ..blender.property_definitions import effective_values, options_of
from ..carried.carrying import CarriedPose
from ..core.errors import UserError
from ..core.geometry.edges import Topology
from ..core.runtime import native
from ..core.runtime.jobs import ProgressTracker
from ..core.settings.choices import STYLIZE
from ..core.settings.parameters import DEFORM, is_fast, presets
from ..handles.native_handles import held_points, native_handles
from ..surface.source_surface import PointsBefore, SourceSurface
from .contact import ContactTerm, native_contact
from .secondary_motion import SecondaryMotion

# The input of a solver, read on the main thread, and the samples that a worker derives from it once.

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


# Requests, and the solver that turns each into a shape from rest, deformed or stylized.

# A pose that a solver turns into a shape, read on the main thread.


class StyleTerm(NamedTuple):
    """A style's parameters for the solver; terms of equal `key` are equal."""

    key: tuple
    directions: object  # (k, 3) preferred normals in solve space, or the ObjectStyle there
    strength: float
    sharpness: float
    up: np.ndarray  # (3,)

    @property
    def what(self):
        """The key without strength and sharpness."""
        return self.key[:-2]


class Request(NamedTuple):
    """One pose. Requests that are alike have the same shape when solved from rest."""

    targets: list  # the handles' targets: (4, 4), or (3,) for a point, in solve space
    style: StyleTerm | None
    points: np.ndarray  # (n, 3) the source's points before the field, in local coordinates
    handles: list  # at rest
    energy: dict  # weights of the energy's terms, by name
    carried: list  # carried.carried_objects.CarriedPose of each carried object
    motion: SecondaryMotion | None
    contact: ContactTerm | None = None

    @property
    def style_key(self):
        return None if self.style is None else self.style.key

    @property
    def contact_key(self):
        return None if self.contact is None else self.contact.key

    def goes_on_from(self, earlier):
        """Whether a solve may start from the shape of an earlier one: handles or a slider are dragged."""
        what, before = (None if one.style is None else one.style.what for one in (self, earlier))
        return what == before

    def digest(self, *further):
        """Hash of the request and of `further`, parameters of its source; equal for equal shapes."""
        carried = [(pose.points, pose.rest, pose.now, pose.parent) for pose in self.carried]
        hashed = hashlib.sha1()
        parts = self.targets, self.style_key, self.points, self.handles, self.energy, carried, self.motion
        parts += (self.contact_key,)
        for part in flat((parts, further)):
            hashed.update(part)
        return hashed.hexdigest()

    def is_like(self, other):
        """Whether both ask for the same shape."""
        return (
            self.style_key == other.style_key
            and self.energy == other.energy
            and self.motion == other.motion
            and self.contact_key == other.contact_key
            and self.handles is other.handles
            and (self.points is other.points or np.array_equal(self.points, other.points))
            and len(self.carried) == len(other.carried)
            and all(map(CarriedPose.same, self.carried, other.carried))
            and len(self.targets) == len(other.targets)
            and all(map(np.array_equal, self.targets, other.targets))
        )


def flat(value):
    """Yields the bytes of a value, recursively through containers and dataclasses."""
    if isinstance(value, np.ndarray):
        yield value.tobytes()
    elif is_dataclass(value):
        yield from flat([getattr(value, one.name) for one in fields(value)])
    elif isinstance(value, dict):
        yield from flat(sorted(value.items()))
    elif isinstance(value, tuple | list):
        yield b"("
        for one in value:
            yield from flat(one)
    else:
        yield repr(value).encode()


# A style's solve from rest, and its finish on the mesh's vertices: of the operator, live mode and bakes.


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


# The solver of live mode, bakes and exports: a request in, a shape out.

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
