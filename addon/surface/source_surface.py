# SPDX-License-Identifier: GPL-3.0-or-later
"""One source's surface, samples, fit and extraction: read on the main thread, computed on the worker."""

import json
from dataclasses import dataclass
from functools import cached_property

import bpy
import numpy as np

from ..blender import mesh_arrays, modifier_stack, user_preferences
from ..blender.evaluation import world_matrix
from ..blender.object_references import ObjectReference, settings_of
from ..blender.property_definitions import effective_values, options_of
from ..blender.splat_layouts import Splats
from ..blender.vertex_groups import NearestVertices
from ..core.errors import UserError
from ..core.files import fit_key
from ..core.geometry import spaces
from ..core.geometry.edges import build_edges, most_frequent
from ..core.geometry.spaces import Space, space_of
from ..core.runtime import native
from ..core.settings.parameters import FIT, QUALITIES, native_options
from ..field_modifier import motion
from ..handles import native_handles
from ..stiffness import painted

# The neural implicit surface fitted to a source's mesh, cached on disk, and whether it is out of date.

# The neural implicit surface fitted to a source's mesh, cached on disk.

VERSION = 1  # increased when fits of earlier versions must not be used


class SurfaceFit:
    """A fit of (n, 3) vertices and (m, 3) triangles with these options; computed once, on a worker."""

    def __init__(self, vertices, triangles, options, machine, cache):
        self.vertices, self.triangles, self.options = vertices, triangles, options
        self._machine, self._cache, self._surface = machine, cache, None

    @cached_property
    def key(self):
        """Key of the fit in the cache; hashing a large mesh is slow, so only workers use it."""
        return fit_key(self.vertices, self.triangles, self.options, VERSION)

    @property
    def is_cached(self):
        return self._cache.path(self.key).exists()

    def surface(self, tracker, weight, again=False):
        """The fitted surface, from the cache unless `again` is set."""
        if self._surface is None:
            cached = None if again else self._cache.load(self.key, native.library().NeuralSdf.load)
            self._surface = self._fitted(tracker, weight) if cached is None else cached
        return self._surface

    def _fitted(self, tracker, weight):
        options = options_of("fit", self.options, self._machine)
        task = tracker.start("Fitting", weight)
        sdf = native.library().fit_sdf(self.vertices, self.triangles, options, task=task)
        try:
            self._cache.save(self.key, sdf.save)
        except (ValueError, OSError) as error:
            tracker.warnings.append(UserError("The fit is used, but could not be kept: {error}", error=error))
        return sdf


def read_fit(settings, operator, vertices, triangles):
    """The SurfaceFit of a mesh by the settings; main thread."""
    options = native_options("fit", fit_values(settings.fit, operator))
    machine, cache = user_preferences.machine_options(), user_preferences.fit_cache()
    return SurfaceFit(vertices, triangles, options, machine, cache)


def fit_values(group, operator):
    """The effective settings of the fit; an operator's `quality` overrides the object's other settings."""
    values = effective_values(FIT, group, operator)
    if operator is not None and operator.properties.is_property_set("quality"):
        preset = QUALITIES[operator.quality][2]
        values |= {n: v for n, v in preset.items() if not operator.properties.is_property_set(n)}
    return values


# Tracks whether meshes or settings have changed since their fit, by depsgraph updates only.

changed = set()  # session_uid of objects whose geometry was updated since their fit


def options_text(settings):
    """The settings of an object's fit as a comparable text."""
    return json.dumps(sorted(native_options("fit", fit_values(settings.fit, None)).items()))


def mark_fitted(source, surface):
    """Marks the source's fit as up to date."""
    changed.discard(source.session_uid)
    settings_of(source).fit_options = json.dumps(sorted(surface.fit.options.items()))


def outdated(source):
    """Text to translate that says why the last fit is out of date; "" if it is not known to be."""
    if source.session_uid in changed:
        return "The mesh changed since the fit"
    settings = settings_of(source)
    return "The settings changed since the fit" if settings.fit_options != options_text(settings) else ""


def watch(depsgraph):
    """Records the objects whose geometry a depsgraph has updated."""
    for update in depsgraph.updates:
        if update.is_updated_geometry and isinstance(update.id, bpy.types.Object):
            source = update.id.original
            if settings_of(source).fit_key and source.session_uid not in motion.written:
                changed.add(source.session_uid)


# One source's surface, samples and extraction: read on the main thread, computed on the worker.

# Points of a source as the modifiers before the field move them, possibly off the surface at rest.
#
# A field is solved on the surface at rest and is inaccurate off it. So each point follows its rest point r,
# and its offset from r rotates with the field:
#
# y = f(r) + c + R (p - r - c), R the rotation of f's Jacobian at r, c the median offset.
#
# A translation c of all points is left out of the offsets, so that it does not rotate.


class PointsBefore:
    """Points of a SourceSurface before the field: (n, 3) `local`, in solve space `now`, and `rest`."""

    def __init__(self, surface, local):
        self.local, self.rest, self.now = local, surface.vertices, surface.vertices
        self.turned, self._offsets, self._of = (), None, (None, None)
        if not np.array_equal(local, surface.local):
            self.now = surface.space.to_solve(local)
            offsets = self.now - self.rest
            offsets -= np.median(offsets, axis=0)
            self.turned = np.flatnonzero(offsets.any(axis=1))
            self._offsets = offsets[self.turned]

    @property
    def needs_field(self):
        return len(self.turned) > 0

    @property
    def is_at_rest(self):
        return self.now is self.rest

    def beside(self, points):
        """A PointsBeside for (k, 3) points in solve space."""
        return PointsBeside(self, points)

    def turns(self, field):
        """(k, 3) displacements (R - 1) (p - r - c) of the points `turned`, those with an offset."""
        if self._of[0] is not field:
            turns = spaces.closest(field.jacobian(self.rest[self.turned]))
            self._of = field, np.einsum("nij,nj->ni", turns - np.eye(3), self._offsets)
        return self._of[1]

    def moved(self, solved, field):
        """(n, 3) moved points; `solved`: the rest points moved by the field."""
        if self.is_at_rest:
            return solved
        after = self.now.astype(solved.dtype) + (solved - self.rest.astype(solved.dtype))
        if self.needs_field:
            after[self.turned] += self.turns(field)
        return after


class PointsBeside:
    """(k, 3) points near the surface before the field, which follow its nearest vertices."""

    def __init__(self, before, points):
        self.before, self._near = before, NearestVertices(before.now, points)
        self._offsets = self._blend(before.now - before.rest)
        self.at_rest = points - self._offsets  # near the surface at rest

    def moved(self, solved, field):
        """(k, 3) moved points; `solved`: the points `at_rest` moved by the field."""
        turns = np.zeros_like(self.before.rest)
        if self.before.needs_field:
            turns[self.before.turned] = self.before.turns(field)
        return solved + self._offsets + self._blend(turns)

    def _blend(self, vectors):
        return np.stack([self._near.blend(column) for column in vectors.T], axis=1)


# One source's surface, samples and extraction: read on the main thread, computed on the worker.


@dataclass(frozen=True)
class SourceSurface:
    """A source in solve space: its mesh, and its implicit surface, exact or fitted."""

    reference: ObjectReference
    space: Space
    local: np.ndarray  # (n, 3) vertices of the shape to solve
    vertices: np.ndarray  # (n, 3) the same in solve space
    triangles: np.ndarray
    fit: SurfaceFit
    in_place: bool  # whether the shape is that at the field modifier's place, without later modifiers
    has_free_normals: bool
    exact: bool  # whether the implicit surface is the mesh's signed distance instead of a fit
    stiffness: tuple  # (n,) factors of stretch and of bending stiffness of the vertices; None: all 1
    solids: list  # (vertices, triangles) of carried meshes to sample as well
    splats: Splats | None = None  # attributes of the vertices
    shown: tuple | None = None  # ((m, 3) points of the surface, (m, 3) shown) of a subdivided one
    materials: np.ndarray | None = None  # (m,) index of each triangle's material; None: the first

    @cached_property
    def _exact_surface(self):
        return native.library().MeshSdf(self.vertices, self.triangles)

    @cached_property
    def prepared(self):
        """PreparedSplats; on the worker."""
        return native.library().PreparedSplats(self.splats.made(native.library()))

    def splat_changes(self, field):
        """(n, 3) moved centers of splats and {attribute: its change}; (None, None) without splats."""
        return (None, None) if self.splats is None else self.splats.changes(self.prepared, field)

    def implicit(self, tracker, weight):
        """The chosen implicit surface; on the worker."""
        return self._exact_surface if self.exact else self.fit.surface(tracker, weight)

    @property
    def faces(self):
        """The triangles of the vertices, by which a field tells touching parts apart; None without any."""
        return self.triangles if self.splats is None and len(self.triangles) else None

    def samples(self, tracker, count, seed, own_triangles):
        """Uniform samples of the implicit surface, or with `own_triangles` of the mesh."""
        af = native.library()
        if self.splats is not None:
            task = tracker.start("Sampling", 0.15)
            return native.library().sample_splats(self.prepared.rest, count, task=task)
        if not own_triangles:
            sdf = self.implicit(tracker, 0.3)
            samples = af.sample_surface(sdf, count=count, seed=seed, task=tracker.start("Sampling", 0.15))
            return self.with_stiffness(samples)
        stretch, bend = self.stiffness
        if self.solids:
            meshes, others = [(self.vertices, self.triangles), *self.solids], [None] * len(self.solids)
            weights = {"weights": [stretch, *others], "bend_weights": [bend, *others]}
            return af.sample_meshes(meshes, count=count, seed=seed, **weights)
        weights = {"weights": stretch, "bend_weights": bend}
        return af.sample_mesh(self.vertices, self.triangles, count=count, seed=seed, **weights)

    def with_stiffness(self, samples):
        """Samples of an implicit surface with the stiffness of their nearest vertices."""
        if all(factors is None for factors in self.stiffness):
            return samples
        near = NearestVertices(self.vertices, samples.points)
        weights = [None if one is None else np.exp(near.blend(np.log(one))) for one in self.stiffness]
        return samples.with_weights(*weights)

    def turns(self, field, points, place=None):
        """(n, 3) rotation vectors of free custom normals at points in solve space; None without such normals.

        `place`: the (4, 4) part of the motion that becomes the object's transform.
        """
        if not self.has_free_normals:
            return None
        jacobians = field.jacobian(points)
        if place is not None:
            jacobians = np.linalg.inv(place[:3, :3]) @ jacobians
        return spaces.turns(jacobians, self.space.local_to_solve)

    def extract(self, tracker, weight, **extraction):
        """(k, 3) vertices and the topology of the implicit surface, in solve space.

        `extraction`: the library's resolution and refine_thin; `weight`: the fit's share of the progress.
        """
        sdf = self.implicit(tracker, weight)
        mesh = native.library().extract_surface(sdf, **extraction, task=tracker.start("Extracting", 1.0))
        warn_of_pieces(tracker, mesh.report)
        return self.checked(*mesh, self.vertices)

    def extract_moved(self, tracker, field, **extraction):
        """The same of the deformed surface, by marching cubes in deformed space; and figures of a report."""
        sdf, task = self.implicit(tracker, 0.0), tracker.start("Extracting", 1.0)
        mesh = native.library().extract_deformed(sdf, field, **extraction, task=task)
        warn_of_pieces(tracker, mesh.report)
        figures = {name: mesh.report[name] for name in ("inverted", "failures")}
        return *self.checked(*mesh, field(self.vertices)), figures

    def checked(self, vertices, corners, moved):
        """The vertices and the topology of a surface. Its triangles have the materials of the nearest ones of
        the mesh, with the mesh's vertices `moved`."""
        if not len(corners):
            raise UserError("The fitted surface is empty; fit with more quality")
        materials = None
        if self.materials is not None:
            own = moved, self.triangles
            nearest = native.library().Correspondence(moved, own, (vertices, corners)).triangles
            materials = most_frequent(self.materials[nearest][corners])
        return vertices, build_edges(corners, materials)


def warn_of_pieces(tracker, report):
    if report.holding_resolution:
        figures = {"pieces": report.pieces, "resolution": report.holding_resolution}
        tracker.warnings.append(
            UserError(
                "Thin parts came apart into {pieces} pieces; resolution {resolution} or Refine Thin Parts "
                "holds them together",
                **figures,
            )
        )


def in_world_shape(splats, space, source):
    """Returns the splats, or None; UserError if the object's scale would stretch them."""
    if splats is not None and not np.array_equal(space.local_to_solve, np.eye(4)):
        raise UserError("{name}: its scale stretches splats; apply the scale, or make it uniform", source)
    return splats


def read_surface(
    context, source, in_place=False, *, exact=None, fit_operator=None, carrying=None, frame=None, space=None
):
    """The SourceSurface of an object; UserError if it cannot be read. Main thread.

    `exact` and the arguments of `fit_operator` override the object's settings. With `carrying`
    (carried/carrying.py), for a solve, painted stiffness is read, and carried meshes are sampled as well.
    `frame`: the frame to read, by default the current one. `space`: the solve space, by default that of the
    object's present matrix.
    """
    context.view_layer.update()
    mesh, settings = mesh_arrays.read(context, source, in_place, frame), settings_of(source)
    space = space or space_of(world_matrix(source), source.name)
    vertices, below = space.to_solve(mesh.vertices), modifier_stack.before(source, in_place)
    return SourceSurface(
        reference=ObjectReference(source),
        space=space,
        local=mesh.vertices,
        vertices=vertices,
        triangles=mesh.triangles,
        fit=read_fit(settings, fit_operator, vertices, mesh.triangles),
        in_place=in_place,
        has_free_normals=mesh.has_free_normals,
        exact=settings.surface == "EXACT" if exact is None else exact,
        stiffness=(None, None) if carrying is None else painted.read(context, source, in_place),
        solids=[] if carrying is None else carrying.solids(context, space),
        splats=in_world_shape(mesh.splats, space, source),
        materials=mesh.materials,
        shown=None
        if carrying is None
        else native_handles.read_subdivided(context, source, in_place, below, space.to_solve),
    )
