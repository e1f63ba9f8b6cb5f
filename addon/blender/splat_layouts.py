# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaussian splats as importers leave them: meshes of points alone, with these attributes on them."""

import numpy as np

from ..core.errors import UserError
from ..names import CHANGES

FLOAT, VECTOR = "FLOAT", "FLOAT_VECTOR"
WIDTHS, BLOCK = {FLOAT: 1, VECTOR: 3}, 16384
LEAST = 1e-6  # opacity; and what is left to full opacity
COUNTS = (16, 9, 4, 1)  # of spherical harmonics


class FileLayout:
    """The common file's own names: Blender's PLY import, and KIRI's 3DGS Render (vertices) that calls it."""

    mark = "f_dc_0"

    def columns(self, attributes):
        """{attribute: its type} that a motion changes."""
        rest = sum(name.startswith("f_rest_") for name, _ in attributes.items())
        names = [f"rot_{k}" for k in range(4)] + [f"scale_{k}" for k in range(3)]
        names += [f"f_dc_{k}" for k in range(3)] + [f"f_rest_{k}" for k in range(rest)]
        return dict.fromkeys(names, FLOAT)

    opacity = "opacity"

    def arrays(self, values):
        """Arguments of GaussianSplats but for the centers."""
        table = np.stack(list(values.values())[:-1], axis=1)
        harmonics = np.concatenate([table[:, 7:10, None], table[:, 10:].reshape(len(table), 3, -1)], axis=2)
        alpha = 1.0 / (1.0 + np.exp(-values[self.opacity]))
        return table[:, :4], np.exp(table[:, 4:7]), alpha, harmonics.swapaxes(1, 2)

    def parts(self, splats, columns):
        """Arrays (n, …) that have the columns' values side by side."""
        colours = splats.harmonics
        return splats.rotations, np.log(splats.scales), colours[:, 0], colours[:, 1:].swapaxes(1, 2)


class VectorLayout:
    """ReshotAI's Gaussian Splatting: vectors, a quaternion in other letters (w, x, y and z), Euler angles."""

    mark = "quatxyz"

    def columns(self, attributes):
        names = ["quatxyz", "scale", "logscale", "rot_euler"]
        names += [f"sh{k}" for k in range(16) if f"sh{k}" in attributes]
        return {"quatw": FLOAT, **dict.fromkeys(names, VECTOR)}

    opacity = "opacity"

    def arrays(self, values):
        harmonics = np.stack([value for name, value in values.items() if name.startswith("sh")], axis=1)
        turns = np.column_stack([values["quatxyz"], values["quatw"]])
        return turns, values["scale"], values[self.opacity], harmonics

    def parts(self, splats, columns):
        turns, colours = splats.rotations, splats.harmonics
        w, x, y, z = turns.T
        angles = [
            np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
            np.arcsin(np.clip(2 * (w * y - z * x), -1, 1)),
            np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
        ]
        own = {"quatw": turns[:, 3:], "quatxyz": turns[:, :3], "scale": splats.scales}
        own |= {"logscale": np.log(splats.scales), "rot_euler": np.stack(angles, axis=1)}
        own |= {f"sh{k}": colours[:, k] for k in range(colours.shape[1])}
        return [own[name] for name in columns]


LAYOUTS = (FileLayout(), VectorLayout())


def layout_of(mesh):
    """The layout of a mesh that holds splats, or None."""
    if len(mesh.polygons):
        return None
    return next((layout for layout in LAYOUTS if layout.mark in mesh.attributes), None)


def columns_of(mesh):
    """{attribute: its type} that a motion changes; empty where the mesh holds no splats."""
    layout = layout_of(mesh)
    return {} if layout is None else layout.columns(mesh.attributes)


class Splats:
    """What a mesh holds of splats, read on the main thread; the library's own are made later."""

    def __init__(self, name, mesh, centers):
        self.layout, self.columns = layout_of(mesh), columns_of(mesh)
        given = {
            key: read(name, mesh, key, kind)
            for key, kind in {**self.columns, self.layout.opacity: FLOAT}.items()
        }
        self.rest = by_column([given[key] for key in self.columns])
        self.spare = None  # splats whose memory the next that are moved take
        turns, scales, alpha, colours = self.layout.arrays(given)
        count = next((count for count in COUNTS if colours.shape[1] == count), None)
        if count is None:
            raise UserError(
                "{name}: its splats have {count} colours, not 1, 4, 9 or 16",
                name=name,
                count=colours.shape[1],
            )
        lengths = np.linalg.norm(turns, axis=1, keepdims=True)
        if not (lengths > 0).all():
            raise UserError("{name}: a splat's rotation is zero", name=name)
        self.arrays = centers, turns / lengths, scales, np.clip(alpha, LEAST, 1 - LEAST), colours

    def made(self, library):
        """The library's own splats."""
        return library.GaussianSplats(*self.arrays)

    def changes(self, prepared, field):
        """{attribute: what is added to it} where a field moves the splats."""
        spare, self.spare = self.spare, None  # of whichever thread comes first
        moved = prepared.moved(field, spare, max_stretch=np.inf)
        changes, found, place = by_column(self.layout.parts(moved, self.columns)), {}, 0
        changes -= self.rest
        for key, kind in self.columns.items():
            found[key] = changes[place] if kind == FLOAT else changes[place : place + 3].T
            place += WIDTHS[kind]
        self.spare = moved
        return found


def by_column(parts):
    """(k, n) in single precision, of arrays (n, …); a block of rows after the other stays in the cache."""
    count = len(parts[0])
    result = np.empty((sum(part[:1].size for part in parts), count), dtype=np.float32)
    for first in range(0, count, BLOCK):
        place = 0
        for part in parts:
            rows = part[first : first + BLOCK].reshape(min(BLOCK, count - first), -1).T
            result[place : place + len(rows), first : first + BLOCK] = rows
            place += len(rows)
    return result


def read(name, mesh, key, kind):
    attribute = mesh.attributes.get(key)
    if attribute is None or (attribute.domain, attribute.data_type) != ("POINT", kind):
        raise UserError("{name}: its splats have no {attribute}", name=name, attribute=key)
    width = WIDTHS[kind]
    flat = np.empty(width * len(attribute.data), dtype=np.float32)
    attribute.data.foreach_get("vector" if kind == VECTOR else "value", flat)
    if not np.isfinite(flat).all():
        raise UserError("{name}: {attribute} of its splats has NaN or infinity", name=name, attribute=key)
    values = flat.astype(np.float64)
    return values.reshape(-1, 3) if kind == VECTOR else values


def put_changes(mesh, changes):
    """Puts what is added to each attribute on the mesh, and takes away what is there besides."""
    for name in names_of_changes(mesh):
        if name.removeprefix(CHANGES) not in changes:
            mesh.attributes.remove(mesh.attributes[name])
    for key, values in changes.items():
        kind, field = (VECTOR, "vector") if values.ndim == 2 else (FLOAT, "value")
        attribute = mesh.attributes.get(CHANGES + key) or mesh.attributes.new(CHANGES + key, kind, "POINT")
        attribute.data.foreach_set(field, np.ascontiguousarray(values, dtype=np.float32).ravel())


def names_of_changes(mesh):
    return [name for name, _ in mesh.attributes.items() if name.startswith(CHANGES)]


def changes_of(mesh):
    """{attribute: what is added to it}; None: nothing is."""
    kinds = {name: mesh.attributes[name].data_type for name in names_of_changes(mesh)}
    found = {name.removeprefix(CHANGES): read(mesh.name, mesh, name, kind) for name, kind in kinds.items()}
    return {key: values.astype(np.float32) for key, values in found.items()} or None
