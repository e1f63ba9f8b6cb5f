# SPDX-License-Identifier: GPL-3.0-or-later
"""The neural implicit surface fitted to a source's mesh, cached on disk."""

from functools import cached_property

from ..blender import user_preferences
from ..blender.native_options import options_of
from ..blender.property_definitions import effective_values
from ..core.errors import UserError
from ..core.runtime import native
from ..core.runtime.fit_cache import fit_key
from ..core.settings.parameters import FIT, QUALITIES, native_options

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
