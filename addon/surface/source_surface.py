# SPDX-License-Identifier: GPL-3.0-or-later
"""The work of one object, read on the main thread and run on the worker: surface, samples, extraction."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..blender import mesh_arrays, property_definitions, user_preferences
from ..blender.object_references import ObjectReference, settings_of
from ..blender.vertex_groups import NearestVertices
from ..core.errors import UserError
from ..core.geometry import rotations
from ..core.geometry.edges import build_edges
from ..core.geometry.spaces import Space, space_of
from ..core.runtime import native
from ..core.runtime.fit_cache import FitCache, fit_key
from ..core.settings.fitting import FIT, QUALITIES
from ..core.settings.parameters import native_options

VERSION = 1  # raised whenever fits of older versions must not be used


@dataclass
class SourceSurface:
    """A source in solve space, with what its fit needs."""

    reference: ObjectReference
    space: Space
    local: np.ndarray  # (n, 3) vertices of the shape that is worked on
    vertices: np.ndarray  # (n, 3) the same in solve space
    triangles: np.ndarray
    fit_options: dict
    cache: FitCache
    machine: dict = field(default_factory=dict)
    in_place: bool = False  # the shape at the place of the field's modifier, not all that is shown
    has_free_normals: bool = False
    exact: bool = True  # whether the implicit surface is the triangles', or a fit of them
    together: list = field(default_factory=list)  # (vertices, triangles) of what is sampled with it
    painted: tuple = (None, None)  # (n,) factors of the vertices' stiffness, and of that against bending
    refine_thin: bool = False  # whether extraction cuts its cells up at thin parts
    _sdf: object = None  # the fitted surface, once it was asked for
    _triangles: object = None  # the exact one

    @cached_property
    def key(self):
        """Name of the fit in the cache; reading a large mesh takes a while, so workers ask for it."""
        return fit_key(self.vertices, self.triangles, self.fit_options, VERSION)

    @property
    def is_cached(self):
        return self.cache.path(self.key).exists()

    def fit(self, tracker, weight, again=False):
        """The fitted surface, from the cache unless it shall be made `again`; runs on the worker."""
        if self._sdf is None:
            self._sdf = self._fitted(tracker, weight, again)
        return self._sdf

    def _fitted(self, tracker, weight, again):
        af = native.library()
        cached = None if again else self.cache.load(self.key, af.NeuralSdf.load)
        if cached is not None:
            return cached
        options = af.FitOptions(**self.fit_options, **supported_options(af.FitOptions, self.machine))
        sdf = af.fit_sdf(self.vertices, self.triangles, options, task=tracker.start("Fitting", weight))
        try:
            self.cache.save(self.key, sdf.save)
        except (ValueError, OSError) as error:
            tracker.warnings.append(UserError("the fit is used, but could not be kept: {error}", error=error))
        return sdf

    def implicit(self, tracker, weight):
        """The implicit surface that was chosen; runs on the worker."""
        if not self.exact:
            return self.fit(tracker, weight)
        if self._triangles is None:
            self._triangles = native.library().MeshSdf(self.vertices, self.triangles)
        return self._triangles

    def samples(self, tracker, count, seed, own_triangles):
        """Points spread evenly over the implicit surface, or over all of the mesh's own triangles."""
        af = native.library()
        if not own_triangles:
            sdf = self.implicit(tracker, 0.3)
            samples = af.sample_surface(sdf, count=count, seed=seed, task=tracker.start("Sampling", 0.15))
            return self.painted_samples(samples)
        weights, bend = self.painted
        if self.together:
            meshes, rest = [(self.vertices, self.triangles), *self.together], [None] * len(self.together)
            painted = {"weights": [weights, *rest], "bend_weights": [bend, *rest]}
            return af.sample_meshes(meshes, count=count, seed=seed, **painted)
        painted = {"weights": weights, "bend_weights": bend}
        return af.sample_mesh(self.vertices, self.triangles, count=count, seed=seed, **painted)

    def painted_samples(self, samples):
        """Samples of an implicit surface, as stiff as the vertices near them."""
        if all(factors is None for factors in self.painted):
            return samples
        near = NearestVertices(self.vertices, samples.points)
        painted = [
            None if factors is None else np.exp(near.blend(np.log(factors))) for factors in self.painted
        ]
        return samples.with_weights(*painted)

    def turns(self, field, points):
        """(n, 3) how a field turns free custom normals at points in solve space; None: there are none."""
        if not self.has_free_normals:
            return None
        return rotations.turns(field.jacobian(points), self.space.local_to_solve)

    def extract(self, tracker, resolution, weight):
        """(k, 3) vertices and the topology of the implicit surface, in solve space."""
        af, sdf = native.library(), self.implicit(tracker, weight)
        mesh = af.extract_surface(sdf, **self.extraction(tracker, resolution))
        warn_of_pieces(tracker, mesh.report)
        return checked_mesh(*mesh)

    def extract_moved(self, tracker, field, resolution):
        """The same of the surface where the field moves it, by marching cubes there; and a report."""
        af, sdf = native.library(), self.implicit(tracker, 0.0)
        mesh = af.extract_deformed(sdf, field, **self.extraction(tracker, resolution))
        warn_of_pieces(tracker, mesh.report)
        return *checked_mesh(*mesh), {name: mesh.report[name] for name in ("inverted", "failures")}

    def extraction(self, tracker, resolution):
        """Arguments of an extraction."""
        task = tracker.start("Extracting", 1.0)
        return {"resolution": resolution, "refine_thin": self.refine_thin, "task": task}


def warn_of_pieces(tracker, report):
    if report.holding_resolution:
        figures = {"pieces": report.pieces, "resolution": report.holding_resolution}
        tracker.warnings.append(
            UserError(
                "thin parts came apart into {pieces} pieces; resolution {resolution} or Refine Thin Parts "
                "holds them together",
                **figures,
            )
        )


def checked_mesh(vertices, corners):
    if not len(corners):
        raise UserError("the fitted surface is empty; fit with more quality")
    return vertices, build_edges(corners)


def supported_options(options, values):
    """The values that this class of native options has a field for."""
    return {name: value for name, value in values.items() if name in options.fields}


def build_options(options, values):
    """Native options of this class: the settings' values, and those that depend on the machine."""
    machine = supported_options(options, user_preferences.machine_options())
    return options(**native_options(values), **machine)


def fit_values(group, operator):
    """The fit's settings that count; an operator's `quality` counts before single settings of the object."""
    if operator is None:
        return {p.name: property_definitions.from_single_precision(getattr(group, p.name)) for p in FIT}
    values = property_definitions.effective_values(FIT, group, operator)
    if operator.properties.is_property_set("quality"):
        preset = QUALITIES[operator.quality][2]
        values |= {n: v for n, v in preset.items() if not operator.properties.is_property_set(n)}
    return values


def read_surface(context, source, operator=None, in_place=False):
    """Everything of a source that the worker needs; UserError when it cannot be worked on."""
    context.view_layer.update()
    mesh = mesh_arrays.read(context, source, in_place)
    space = space_of(source.matrix_world, source.name)
    vertices = space.to_solve(mesh.vertices)
    options = native_options(fit_values(settings_of(source).fit, operator))
    return SourceSurface(
        reference=ObjectReference(source),
        space=space,
        local=mesh.vertices,
        vertices=vertices,
        triangles=mesh.triangles,
        fit_options=options,
        cache=user_preferences.fit_cache(),
        machine=user_preferences.machine_options(),
        in_place=in_place,
        has_free_normals=mesh.has_free_normals,
    )
