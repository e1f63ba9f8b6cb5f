# SPDX-License-Identifier: GPL-3.0-or-later
"""Inputs of verbs by kind."""

import arapfields as af

from .._files import existing_file
from . import files, points, splat_files
from .running import with_progress

SOURCES = (*files.MESH_SUFFIXES, *files.STATE_SUFFIXES)


class Source:
    """An input: a mesh, splats or a saved signed distance."""

    def __init__(self, args):
        self._args = args
        self.path = existing_file(args.input, SOURCES)
        self.splats = af.GaussianSplats.load(self.path) if af.GaussianSplats.is_file(self.path) else None
        self.mesh = files.read_surface(self.path) if files.is_mesh(self.path) and not self.splats else None
        self._sdf = None if self.mesh or self.splats else files.read_sdf(self.path)

    def sdf(self):
        if self.splats:
            raise af.InvalidInput(f"{self.path}: holds splats; a mesh or a signed distance is needed")
        if self._sdf is None:
            exact = self._args.sdf == "exact"
            self._sdf = self.distances() if exact else fitted(*self.mesh.surface, af.FitOptions(), self._args)
        return self._sdf

    def distances(self):
        return af.MeshSdf(*self.mesh.surface) if self.mesh else self._sdf

    def write_moved(self, path, field, finish=None):
        """Writes the mesh or splats moved by a field.

        `finish(vertices, triangles, moved)` gives a mesh's final positions.
        """
        if self.splats:
            moved = field.apply_to(self.splats)
            splat_files.write(path, moved, up=self._args.up_axis, name=self.path.stem)
            return

        def move(vertices):
            moved = field(vertices)
            return moved if finish is None else finish(vertices, self.mesh.triangles, moved)

        files.write_moved_mesh(path, self.path, self.mesh, move)


def fitted(vertices, triangles, options, args):
    return with_progress("fit", lambda task: af.fit_sdf(vertices, triangles, options, task=task), args.quiet)


def samples(source, count, seed, args):
    painted = {name: getattr(args, name) for name in ("weights", "bend_weights") if getattr(args, name, None)}
    if source.mesh:
        count_of = len(source.mesh.vertices)
        weights = {name: points.read_weights(path, count_of) for name, path in painted.items()}
        return af.sample_mesh(*source.mesh.surface, count, seed=seed, **weights)
    if painted:
        flag = "--" + next(iter(painted)).replace("_", "-")
        raise af.InvalidInput(
            f"{flag}: {source.path} has no vertices that numbers could be of; a mesh is needed"
        )
    if source.splats:
        return with_progress(
            "sample", lambda task: af.sample_splats(source.splats, count, task=task), args.quiet
        )
    return with_progress(
        "sample", lambda task: af.sample_surface(source.sdf(), count=count, seed=seed, task=task), args.quiet
    )


def read_distance(path):
    """The exact distance of a mesh, or a signed distance written by `fit`."""
    path = existing_file(path, SOURCES)
    return af.MeshSdf(*files.read_mesh(path)) if files.is_mesh(path) else files.read_sdf(path)


def content(path):
    """The bytes of a file; InvalidInput if it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise af.InvalidInput(f"{path}: {error.strerror}") from error
