# SPDX-License-Identifier: GPL-3.0-or-later
"""The work of one object, read on the main thread and run on the worker: surface, samples, extraction."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..blender import mesh_arrays, settings
from ..blender.object_references import ObjectId, settings_of
from ..core.errors import UserError
from ..core.geometry.edges import connected
from ..core.geometry.spaces import Space, space_of
from ..core.runtime import native
from ..core.runtime.fit_cache import FitCache, fit_key
from ..core.settings.fitting import FIT, QUALITIES
from ..core.settings.parameters import native_options

VERSION = 1  # raised whenever fits of older versions must not be used


@dataclass
class Surface:
    """A source in solve space, with what its fit needs."""

    who: ObjectId
    space: Space
    local: np.ndarray  # (n, 3) vertices as shown
    vertices: np.ndarray  # (n, 3) the same in solve space
    triangles: np.ndarray
    fit_options: dict
    cache: FitCache
    machine: dict = field(default_factory=dict)
    _sdf: object = None  # the fitted surface, once it was asked for

    @cached_property
    def key(self):
        """Name of the fit in the cache; reading a large mesh takes a while, so workers ask for it."""
        return fit_key(self.vertices, self.triangles, self.fit_options, VERSION)

    @property
    def is_cached(self):
        return self.cache.path(self.key).exists()

    def fit(self, stages, share, again=False):
        """The fitted surface, from the cache unless it shall be made `again`; runs on the worker."""
        if self._sdf is None:
            self._sdf = self._fitted(stages, share, again)
        return self._sdf

    def _fitted(self, stages, share, again):
        af = native.library()
        ready = None if again else self.cache.load(self.key, af.NeuralSdf.load)
        if ready is not None:
            return ready
        options = af.FitOptions(**self.fit_options, **known(af.FitOptions, self.machine))
        sdf = af.fit_sdf(self.vertices, self.triangles, options, stages.start("Fitting", share))
        self.cache.save(self.key, sdf.save)
        return sdf

    def samples(self, stages, count, seed, use_fit):
        """Points spread evenly over the surface: the fit's when there is one, else the triangles'."""
        af = native.library()
        if use_fit:
            sdf = self.fit(stages, 0.3)
            return af.sample_surface(sdf, count=count, seed=seed, task=stages.start("Sampling", 0.1))
        return af.sample_mesh(self.vertices, self.triangles, count=count, seed=seed)

    def extract(self, stages, resolution, share):
        """(k, 3) vertices and the topology of the implicit surface, in solve space."""
        af = native.library()
        sdf = self.fit(stages, share)
        return whole(*af.extract_surface(sdf, resolution=resolution, task=stages.start("Extracting", 0.2)))

    def extract_moved(self, stages, field, resolution, share):
        """The same of the surface where the field moves it, by marching cubes there; and a report."""
        sdf, report = self.fit(stages, 0.0), {}
        task = stages.start("Extracting", share)
        made = native.library().extract_deformed(sdf, field, resolution, task=task, report=report)
        return *whole(*made), {name: report[name] for name in ("inverted", "failures")}


def whole(vertices, corners):
    if not len(corners):
        raise UserError("the fitted surface is empty; fit with more quality")
    return vertices, connected(corners)


def known(options, values):
    """The values that this class of native options has a field for."""
    return {name: value for name, value in values.items() if name in options.fields}


def fit_values(group, operator):
    """The fit's settings in force; an operator's `quality` counts before single settings of the object."""
    if operator is None:
        return {p.name: settings.plain(getattr(group, p.name)) for p in FIT}
    values = settings.in_force(FIT, group, operator)
    if operator.properties.is_property_set("quality"):
        preset = QUALITIES[operator.quality][2]
        values |= {n: v for n, v in preset.items() if not operator.properties.is_property_set(n)}
    return values


def read_surface(context, source, operator=None):
    """Everything of a source that the worker needs; UserError when it cannot be worked on."""
    context.view_layer.update()
    mesh = mesh_arrays.read(context, source)
    space = space_of(source.matrix_world, source.name)
    vertices = space.to_solve(mesh.vertices)
    options = native_options(fit_values(settings_of(source).fit, operator))
    return Surface(
        who=ObjectId(source),
        space=space,
        local=mesh.vertices,
        vertices=vertices,
        triangles=mesh.triangles,
        fit_options=options,
        cache=settings.fit_cache(),
        machine=settings.machine_options(),
    )
