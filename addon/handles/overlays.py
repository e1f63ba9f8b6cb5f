# SPDX-License-Identifier: GPL-3.0-or-later
"""Overlays of the 3D viewport: previews of running jobs, and the boxes of handles."""

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ..blender import user_preferences
from ..blender.object_references import settings_of, source_of
from ..core.geometry.edges import cluster_vertices, vertex_normals
from . import empties, movers, symmetry

# Previews of running solves, drawn as an overlay, never stored in the file.

PREVIEW_COLOUR = np.array([0.98, 0.60, 0.22], dtype=np.float32)
LIGHT = np.array([0.3, -0.5, 0.81], dtype=np.float32)
AMBIENT = 0.35


class Shown:
    """The mesh to draw: `mesh` is (points in world space, normals, triangles), or None."""

    def __init__(self):
        self.mesh = self.batch = None

    def set(self, mesh):
        self.mesh, self.batch = mesh, None

    def clear(self):
        self.set(None)


shown = Shown()


class Preview:
    """A coarse mesh of the source in solve space, drawn at its moved points."""

    def __init__(self, surface):
        self._surface, self._clustered = surface, None

    @property
    def points(self):
        """(k, 3) points at rest; called on the worker, as clustering a large mesh is slow."""
        if self._clustered is None:
            self._clustered = cluster_vertices(self._surface.vertices, self._surface.triangles)
        return self._clustered.vertices

    def show(self, points):
        world = self._surface.space.solve_to_world
        placed = (points.astype(np.float64) @ world[:3, :3].T + world[:3, 3]).astype(np.float32)
        triangles = self._clustered.triangles
        shown.set((placed, vertex_normals(placed, triangles), triangles))

    def clear(self):
        shown.clear()

    hand_over = keep = clear


def batch_of(points, normals, triangles):
    """GPU batch of the vertices with shaded colours."""
    import gpu

    shade = AMBIENT + (1 - AMBIENT) * np.abs(normals @ LIGHT)
    colours = np.concatenate([PREVIEW_COLOUR * shade[:, None], np.ones((len(shade), 1), np.float32)], axis=1)
    layout = gpu.types.GPUVertFormat()
    layout.attr_add(id="pos", comp_type="F32", len=3, fetch_mode="FLOAT")
    layout.attr_add(id="color", comp_type="F32", len=4, fetch_mode="FLOAT")
    vertices = gpu.types.GPUVertBuf(format=layout, len=len(points))
    vertices.attr_fill("pos", np.ascontiguousarray(points))
    vertices.attr_fill("color", np.ascontiguousarray(colours, dtype=np.float32))
    indices = gpu.types.GPUIndexBuf(type="TRIS", seq=triangles)
    return gpu.types.GPUBatch(type="TRIS", buf=vertices, elem=indices)


def draw_previews():
    import gpu

    if shown.mesh is None:
        return
    if shown.batch is None:
        shown.batch = batch_of(*shown.mesh)
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(True)
    shown.batch.draw(gpu.shader.from_builtin("SMOOTH_COLOR"))
    gpu.state.depth_mask_set(False)
    gpu.state.depth_test_set("NONE")


# Overlay of handles: each rest box with thin lines, the present box with thick ones; faint behind the mesh.
#
# For a pin, whose Empty is a ball on the surface, a line from rest to its present location. Around a
# selected handle, its reach. With symmetry, mirror images of all handles.

CORNERS = np.array([(x, y, z, 1.0) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
EDGES = [(a, b) for a in range(8) for b in range(a) if (CORNERS[a] != CORNERS[b]).sum() == 1]
ANGLES = np.linspace(0, 2 * np.pi, 48, endpoint=False)
CIRCLE_ENDS = 2 * len(ANGLES)
THIN, THICK, CHOSEN = 1.5, 2.5, 4.0  # line widths in pixels: rest box, present box, selected handle
HALO, HALO_ALPHA = 2.0, 0.55  # width in pixels and opacity of a line's dark outline
BEHIND = 0.3  # opacity factor of hidden lines
GHOST = 0.35  # opacity factor of mirrored lines
NEARER = Matrix.Identity(4)  # a little towards the viewer, before the Empty's own lines
NEARER[2][3] = -2e-4
FLAT = np.eye(3)[:2]  # right and up of a viewer who looks along z


def box_lines(matrix):
    """The 24 end points of a box's edges, in world space."""
    corners = (CORNERS @ matrix.T)[:, :3]
    return [corners[end].tolist() for edge in EDGES for end in edge]


def circle_lines(center, radius, across):
    """The ends of a circle's lines in world space; `across` (2, 3) are the viewer's right and up."""
    rim = center + radius * (np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1) @ across)
    return np.stack([rim, np.roll(rim, -1, axis=0)], axis=1).reshape(-1, 3).tolist()


def shown_handles(source):
    """Yields (entry, rest box, present box) of each handle with a visible Empty, and of the active bone's."""
    settings = settings_of(source)
    for index, entry in enumerate(settings.handles):
        if not movers.has_mover(entry) or not movers.mover_of(entry).visible_get():
            continue
        if entry.kind != "BONE" or index == settings.active_handle:
            yield entry, empties.rest_box(source, entry), movers.box_now(entry)


def segments(source, across=FLAT):
    """((r, g, b), width, line ends in world space) of all handles of a source."""
    lines, chosen = [], chosen_of(source)
    for entry, rest, now in shown_handles(source):
        is_chosen = entry.kind == "BONE" or entry.empty.select_get() or entry == chosen
        parts = outline(entry.kind, rest, now, CHOSEN if is_chosen else THICK)
        if is_chosen and entry.reach > 0:
            parts.append((THIN, reach_lines(source, entry, rest, across)))
        lines += [(tuple(entry.colour), width, ends) for width, ends in parts]
    return lines


def chosen_of(source):
    """The handle in the active row of an active source, or None."""
    is_active = bpy.context.view_layer.objects.active == source
    return empties.chosen_entry(source) if is_active else None


def outline(kind, rest, now, thick):
    """[(width, line ends)] of a handle by its rest box and its present box."""
    way = [rest[:3, 3].tolist(), now[:3, 3].tolist()]
    if kind in empties.PINS:
        return [] if np.allclose(*way, atol=1e-6) else [(thick, way)]
    if np.allclose(rest, now, atol=1e-6):
        return [(thick, box_lines(rest))]
    return [(THIN, box_lines(rest)), (thick, box_lines(now) + way)]


def reach_lines(source, entry, rest, across):
    """Line ends of a handle's reach around its rest pose: a larger box for a box, else a circle."""
    halves = np.linalg.norm(rest[:3, :3], axis=0)
    length = entry.reach * np.cbrt(abs(np.linalg.det(movers.matrix_of(source)[:3, :3])))
    if entry.kind in ("CUBE", "BONE"):
        wider = rest.copy()
        wider[:3, :3] *= 1 + length / np.maximum(halves, 1e-12)
        return box_lines(wider)
    held = halves.max() if entry.kind == "PIN" else 0.0
    return circle_lines(rest[:3, 3], length + held, across)


def ghosts(source, across=FLAT):
    """((r, g, b), width, line ends in world space) of mirrored handles, at rest and now.

    Handles on the mirror plane are left out.
    """
    mirror = symmetry.mirror_of(source)
    if mirror is None:
        return []
    lines = []
    for entry, rest, now in shown_handles(source):
        if symmetry.is_on_plane(mirror, rest) and symmetry.is_on_plane(mirror, now):
            continue
        rest, now = mirror @ rest, mirror @ now
        parts = outline(entry.kind, rest, now, THICK)
        if entry.kind in empties.PINS:
            rims = [(THIN, rest), (THICK, now)] if parts else [(THICK, now)]
            parts += [(width, circle_lines(box[:3, 3], radius_of(box), across)) for width, box in rims]
        lines += [(tuple(entry.colour), width, ends) for width, ends in parts]
    return lines


def radius_of(box):
    return np.linalg.norm(box[:3, :3], axis=0).max()


def draw_lines(shader, colour, width, batch, strength=1.0):
    """Draws lines with their outline, faint where the scene hides them."""
    for test, alpha in (("GREATER", BEHIND * strength), ("LESS_EQUAL", strength)):
        gpu.state.depth_test_set(test)
        for shade, wide in (((0, 0, 0, HALO_ALPHA * alpha), width + HALO), ((*colour, alpha), width)):
            shader.uniform_float("color", shade)
            shader.uniform_float("lineWidth", wide)
            batch.draw(shader)


def draw_handle_boxes():
    context = bpy.context
    source = source_of(context) if context.region_data is not None else None
    if (
        source is None
        or not context.space_data.overlay.show_overlays
        or not user_preferences.shows("show_boxes")
    ):
        return
    across = np.array(context.region_data.view_rotation.to_matrix()).T[:2]
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_mask_set(False)
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    with gpu.matrix.push_pop_projection():
        gpu.matrix.load_projection_matrix(NEARER @ gpu.matrix.get_projection_matrix())
        for strength, lines in ((GHOST, ghosts(source, across)), (1.0, segments(source, across))):
            for colour, width, ends in lines:
                batch = batch_for_shader(shader, "LINES", {"pos": ends})
                draw_lines(shader, colour, width, batch, strength)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")
