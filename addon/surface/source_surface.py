# SPDX-License-Identifier: GPL-3.0-or-later
"""The work of one object, read on the main thread and run on the worker: surface, samples, extraction."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..blender.evaluation import world_matrix
from ..blender.object_references import ObjectReference, settings_of
from ..blender.splat_layouts import Splats
from ..blender.vertex_groups import NearestVertices
from ..core.errors import UserError
from ..core.geometry import rotations
from ..core.geometry.edges import build_edges
from ..core.geometry.spaces import Space, space_of
from ..core.runtime import native
from ..handles import subdivided
from ..stiffness import painted
from .surface_fit import SurfaceFit, read_fit


@dataclass(frozen=True)
class SourceSurface:
    """A source in solve space: its mesh, and its implicit surface, that of the triangles or a fit of them."""

    reference: ObjectReference
    space: Space
    local: np.ndarray  # (n, 3) vertices of the shape that is worked on
    vertices: np.ndarray  # (n, 3) the same in solve space
    triangles: np.ndarray
    fit: SurfaceFit
    in_place: bool  # the shape at the place of the field's modifier, not all that is shown
    has_free_normals: bool
    exact: bool  # whether the implicit surface is the triangles', or a fit of them
    stiffness: tuple  # (n,) factors of the vertices' stiffness, and of that against bending; None for 1
    solids: list  # (vertices, triangles) of what is sampled with it
    splats: Splats | None = None  # the vertices' own
    shown: tuple | None = None  # ((m, 3) places on it, (m, 3) where they are seen), where it is subdivided

    @cached_property
    def _exact_surface(self):
        return native.library().MeshSdf(self.vertices, self.triangles)

    @cached_property
    def prepared(self):
        """PreparedSplats; on the worker."""
        return native.library().PreparedSplats(self.splats.made(native.library()))

    def splat_changes(self, field):
        """(n, 3) splats' centers that a field moves, and {attribute: what is added to it}; or None, None."""
        return (None, None) if self.splats is None else self.splats.changes(self.prepared, field)

    def implicit(self, tracker, weight):
        """The implicit surface that was chosen; runs on the worker."""
        return self._exact_surface if self.exact else self.fit.surface(tracker, weight)

    def samples(self, tracker, count, seed, own_triangles):
        """Points spread evenly over the implicit surface, or over all of the mesh's own triangles."""
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
        """Samples of an implicit surface, as stiff as the vertices near them."""
        if all(factors is None for factors in self.stiffness):
            return samples
        near = NearestVertices(self.vertices, samples.points)
        weights = [None if one is None else np.exp(near.blend(np.log(one))) for one in self.stiffness]
        return samples.with_weights(*weights)

    def turns(self, field, points, place=None):
        """(n, 3) how a field turns free custom normals at points in solve space; None: there are none.

        `place`: the (4, 4) part of the motion that the object itself takes.
        """
        if not self.has_free_normals:
            return None
        jacobians = field.jacobian(points)
        if place is not None:
            jacobians = np.linalg.inv(place[:3, :3]) @ jacobians
        return rotations.turns(jacobians, self.space.local_to_solve)

    def extract(self, tracker, weight, **extraction):
        """(k, 3) vertices and the topology of the implicit surface, in solve space.

        `extraction`: the library's resolution and refine_thin; `weight`: of a fit in what is left to do.
        """
        sdf = self.implicit(tracker, weight)
        mesh = native.library().extract_surface(sdf, **extraction, task=tracker.start("Extracting", 1.0))
        warn_of_pieces(tracker, mesh.report)
        return checked_mesh(*mesh)

    def extract_moved(self, tracker, field, **extraction):
        """The same of the surface where the field moves it, by marching cubes there; and a report."""
        sdf, task = self.implicit(tracker, 0.0), tracker.start("Extracting", 1.0)
        mesh = native.library().extract_deformed(sdf, field, **extraction, task=task)
        warn_of_pieces(tracker, mesh.report)
        return *checked_mesh(*mesh), {name: mesh.report[name] for name in ("inverted", "failures")}


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


def checked_mesh(vertices, corners):
    if not len(corners):
        raise UserError("The fitted surface is empty; fit with more quality")
    return vertices, build_edges(corners)


def in_world_shape(splats, space, source):
    """Splats, if any; UserError where the object's scale stretches them."""
    if splats is not None and not np.array_equal(space.local_to_solve, np.eye(4)):
        raise UserError("{name}: its scale stretches splats; apply the scale, or make it uniform", source)
    return splats


def read_surface(
    context, source, in_place=False, *, exact=None, fit_operator=None, carrying=None, frame=None, space=None
):
    """All of a source that the worker needs; UserError when it cannot be worked on. Main thread.

    `exact` and the arguments of `fit_operator` count before the object's settings. `carrying`
    (carried/carrying.py) is given for a solve: the samples are then as stiff as the source is painted, and
    spread over what is carried together with it. `frame`: another than that at hand, whose shape is read.
    `space`: the solve space, where that is not what the object's matrix at hand says.
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
        shown=None if carrying is None else subdivided.read(context, source, in_place, below, space.to_solve),
    )
