# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaussian splats as importers leave them: meshes of points alone, with these attributes on them."""

import numpy as np

from ..core.errors import UserError
from ..names import CHANGES

FLOAT, VECTOR = "FLOAT", "FLOAT_VECTOR"
WIDTHS = {FLOAT: 1, VECTOR: 3}
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

    def rest(self, values):
        """(k, n): the columns' values, less what `changes` adds to them."""
        return by_column(*list(values.values())[:-1])

    def changes(self, splats, rest, columns):
        """{attribute: what is added to it} of splats that moved from there."""
        return dict(zip(columns, splats.columns(rest), strict=True))


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

    def rest(self, values):
        turns, _, _, colours = self.arrays(values)
        others = {name: values[name].astype(np.float32) for name in ("scale", "rot_euler")}
        return by_column(turns, values["logscale"], colours[:, 0], colours[:, 1:].swapaxes(1, 2)), others

    def changes(self, splats, rest, columns):
        rest, others = rest
        changes, (w, x, y, z) = splats.columns(rest), splats.rotations.T
        angles = [
            np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
            np.arcsin(np.clip(2 * (w * y - z * x), -1, 1)),
            np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
        ]
        own = {"quatxyz": changes[:3].T, "quatw": changes[3], "logscale": changes[4:7].T}
        own |= {"scale": splats.scales - others["scale"], "sh0": changes[7:10].T}
        own["rot_euler"] = np.stack(angles, axis=1) - others["rot_euler"]
        functions = (len(changes) - 10) // 3
        own |= {f"sh{k + 1}": changes[10 + k :: functions].T for k in range(functions)}
        return {name: own[name] for name in columns}


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
        self.rest = self.layout.rest(given)
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
        changes = self.layout.changes(moved, self.rest, self.columns)
        self.spare = moved
        return changes


def by_column(*parts):
    """(k, n) in single precision, of arrays (n, …)."""
    return np.concatenate([part.reshape(len(part), -1).T for part in parts], dtype=np.float32)


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
