# SPDX-License-Identifier: GPL-3.0-or-later
"""The neural implicit surface fitted to a source's mesh, cached on disk, and whether it is out of date."""

import json
from functools import cached_property

import bpy

from ..blender import user_preferences
from ..blender.object_references import settings_of
from ..blender.property_definitions import effective_values, options_of
from ..core.errors import UserError
from ..core.runtime import native
from ..core.runtime.fit_cache import fit_key
from ..core.settings.parameters import FIT, QUALITIES, native_options
from ..field_modifier import motion

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


def reason(source):
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
