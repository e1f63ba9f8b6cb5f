# SPDX-License-Identifier: GPL-3.0-or-later
"""Attribute layouts of imported Gaussian splats, on point clouds or on meshes without faces."""

import numpy as np

from ..core.errors import UserError
from ..names import CHANGES
from .point_data import face_count

FLOAT, VECTOR, COLOR, QUATERNION, FLOAT4 = "FLOAT", "FLOAT_VECTOR", "FLOAT_COLOR", "QUATERNION", "FLOAT4"
# {attribute type: (numbers per element, RNA property of the value)}.
NUMBERS = {FLOAT: (1, "value"), VECTOR: (3, "vector"), COLOR: (4, "color")}
NUMBERS |= {QUATERNION: (4, "value"), FLOAT4: (4, "vector")}
KIND_OF = {
    (): FLOAT,
    (3,): VECTOR,
    (4,): COLOR,
}  # of changes; a QUATERNION would become a rotation
LEAST = 1e-6  # least opacity, and least difference from full opacity
COUNTS = (16, 9, 4, 1)  # numbers of spherical harmonics, by degree from 3 to 0
LOGARITHMS = "logarithms"  # key of the scales' logarithms, beside the attributes


class FileLayout:
    """The common file's own names: Blender's PLY import before 5.3, and KIRI's 3DGS Render (vertices)."""

    mark = "f_dc_0"
    fixed = {f"f_dc_{k}": (FLOAT,) for k in range(3)} | {"opacity": (FLOAT,)}  # {attribute: its types}

    def columns(self, attributes):
        """{attribute: its type} of the attributes that a motion changes."""
        rest = sum(name.startswith("f_rest_") for name, _ in attributes.items()) // 3 * 3
        names = [f"rot_{k}" for k in range(4)] + [f"scale_{k}" for k in range(3)]
        return dict.fromkeys([*names, *(f"f_rest_{k}" for k in range(rest))], FLOAT)

    def arrays(self, values, fixed):
        """The arguments of GaussianSplats, except the centers."""
        *first, opacity = fixed.values()
        table = np.stack(list(values.values()), axis=1)
        rest = table[:, 7:].reshape(len(table), 3, -1)
        colours = np.concatenate([np.stack(first, axis=1)[:, :, None], rest], axis=2).swapaxes(1, 2)
        return table[:, :4], np.exp(table[:, 4:7]), 1.0 / (1.0 + np.exp(-opacity)), colours

    def begin(self, rest):
        """Adds derived values to those at rest that `streams` needs."""

    def streams(self, values):
        """Values, or their changes, in the order of PreparedSplats.changes()."""
        return list(values.values())

    def finish(self, rest, changes):
        """Completes the changes after the native library has written to `streams`."""


class VectorLayout(FileLayout):
    """ReshotAI's Gaussian Splatting: vectors, a quaternion in other letters (w, x, y and z), Euler angles."""

    mark = "quatxyz"
    fixed = {"sh0": (VECTOR,), "opacity": (FLOAT,)}

    def columns(self, attributes):
        names = ["quatxyz", "scale", "logscale", "rot_euler"]
        names += [f"sh{k}" for k in range(1, 16) if f"sh{k}" in attributes]
        return {"quatw": FLOAT, **dict.fromkeys(names, VECTOR)}

    def arrays(self, values, fixed):
        harmonics = np.stack([fixed["sh0"], *harmonics_of(values, "sh")], axis=1)
        turns = np.column_stack([values["quatxyz"], values["quatw"]])
        return turns, values["scale"], fixed["opacity"], harmonics

    def streams(self, values):
        shape = [*values["quatxyz"].T, values["quatw"], *values["logscale"].T]
        return [*shape, *(one[:, c] for c in range(3) for one in harmonics_of(values, "sh"))]

    def finish(self, rest, changes):
        changes["scale"][:] = np.exp(rest["logscale"] + changes["logscale"]) - rest["scale"]
        (w, x, y), z = (rest["quatxyz"] + changes["quatxyz"]).T, rest["quatw"] + changes["quatw"]
        angles = [
            np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
            np.arcsin(np.clip(2 * (w * y - z * x), -1, 1)),
            np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
        ]
        changes["rot_euler"][:] = np.stack(angles, axis=1) - rest["rot_euler"]


class OwnLayout(FileLayout):
    """Blender's own, from 5.3 on, of point clouds that it draws as splats.

    Names and types are those of its importers. Blender before 5.3 has no FLOAT4.
    """

    mark = "radiance:base"  # colours of degree 0, and opacity
    fixed = {mark: (FLOAT4, COLOR)}

    def columns(self, attributes):
        names = ["scale", *(f"radiance:sh_{k}" for k in range(15) if f"radiance:sh_{k}" in attributes)]
        return {"rotation": QUATERNION, **dict.fromkeys(names, VECTOR)}

    def arrays(self, values, fixed):
        base = fixed[self.mark]
        harmonics = np.stack([base[:, :3], *harmonics_of(values, "radiance")], axis=1)
        return values["rotation"], values["scale"], base[:, 3], harmonics

    def begin(self, rest):
        rest[LOGARITHMS] = np.log(rest["scale"])

    def streams(self, values):
        shape = [*values["rotation"].T, *values[LOGARITHMS].T]
        return [*shape, *(one[:, c] for c in range(3) for one in harmonics_of(values, "radiance"))]

    def finish(self, rest, changes):
        changes["scale"][:] = rest["scale"] * np.expm1(changes.pop(LOGARITHMS))


def harmonics_of(values, prefix):
    return [value for name, value in values.items() if name.startswith(prefix)]


LAYOUTS = (FileLayout(), VectorLayout(), OwnLayout())


def layout_of(mesh):
    """The layout of a mesh or point cloud that holds splats, or None."""
    if face_count(mesh):
        return None
    return next((layout for layout in LAYOUTS if layout.mark in mesh.attributes), None)


def holds_splats(item):
    """Whether an object is a mesh or a point cloud of splats."""
    return item.type in ("MESH", "POINTCLOUD") and layout_of(item.data) is not None


def columns_of(mesh):
    """{attribute: its type} of the attributes that a motion changes; empty without splats."""
    layout = layout_of(mesh)
    return {} if layout is None else layout.columns(mesh.attributes)


class Splats:
    """A mesh's splat attributes, read on the main thread; `made` converts them to native splats."""

    def __init__(self, name, mesh, centers):
        self.layout, columns = layout_of(mesh), columns_of(mesh)
        self.rest = {key: read(name, mesh, key, kind) for key, kind in columns.items()}
        self.fixed = {key: read(name, mesh, key, *kinds) for key, kinds in self.layout.fixed.items()}
        turns, scales, alpha, colours = self.layout.arrays(self.rest, self.fixed)
        count = next((count for count in COUNTS if colours.shape[1] == count), None)
        if count is None:
            raise UserError(
                "{name}: its splats have {count} colors, not 1, 4, 9 or 16",
                name=name,
                count=colours.shape[1],
            )
        if not (scales > 0).all():
            raise UserError("{name}: a splat's scale is zero or negative", name=name)
        lengths = np.linalg.norm(turns, axis=1, keepdims=True)
        if not (lengths > 0).all():
            raise UserError("{name}: a splat's rotation is zero", name=name)
        self.arrays = centers, turns / lengths, scales, np.clip(alpha, LEAST, 1 - LEAST), colours
        self.attributes = dict(self.rest)  # those at rest by their own names
        self.layout.begin(self.rest)

    def made(self, library):
        """The native GaussianSplats."""
        return library.GaussianSplats(*self.arrays)

    def posed(self, library, centers, changes):
        """The native GaussianSplats with changes() added to the attributes."""
        moved = {key: values + changes[key] for key, values in self.attributes.items()}
        turns, scales, _, colours = self.layout.arrays(moved, self.fixed)
        turns = turns / np.linalg.norm(turns, axis=1, keepdims=True)
        return library.GaussianSplats(centers, turns, scales, self.arrays[3], colours)

    def changes(self, prepared, field):
        """((n, 3) centers moved by a field, {attribute: its change})."""
        changes = {key: np.empty_like(values) for key, values in self.rest.items()}
        streams = self.layout.streams
        centers = prepared.changes(field, streams(self.rest), streams(changes))
        self.layout.finish(self.rest, changes)
        return centers, changes


def read(name, mesh, key, *kinds):
    """(n,), (n, 3) or (n, 4) values of an attribute that has one of these types, in single precision."""
    attribute = mesh.attributes.get(key)
    if attribute is None or attribute.domain != "POINT" or attribute.data_type not in kinds:
        raise UserError("{name}: its splats have no {attribute}", name=name, attribute=key)
    width, field = NUMBERS[attribute.data_type]
    flat = np.empty(width * len(attribute.data), dtype=np.float32)
    attribute.data.foreach_get(field, flat)
    if not np.isfinite(flat).all():
        raise UserError("{name}: {attribute} of its splats has invalid values", name=name, attribute=key)
    return flat if width == 1 else flat.reshape(-1, width)


def put_changes(mesh, changes):
    """Stores the changes of each attribute on the mesh, and removes other stored changes."""
    for name in names_of_changes(mesh):
        if name.removeprefix(CHANGES) not in changes:
            mesh.attributes.remove(mesh.attributes[name])
    kinds = {key: KIND_OF[values.shape[1:]] for key, values in changes.items()}
    for key in [key for key in kinds if CHANGES + key not in mesh.attributes]:
        mesh.attributes.new(CHANGES + key, kinds[key], "POINT")
    there = dict(mesh.attributes.items())  # one lookup per name would take twice as long as writing
    for key, values in changes.items():
        flat = np.ascontiguousarray(values, dtype=np.float32).ravel()
        there[CHANGES + key].data.foreach_set(NUMBERS[kinds[key]][1], flat)


def names_of_changes(mesh):
    return [name for name, _ in mesh.attributes.items() if name.startswith(CHANGES)]


def changes_of(mesh):
    """{attribute: its stored change}; None without any."""
    kinds = {name: mesh.attributes[name].data_type for name in names_of_changes(mesh)}
    return {
        key.removeprefix(CHANGES): read(mesh.name, mesh, key, kind) for key, kind in kinds.items()
    } or None
