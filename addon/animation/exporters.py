# SPDX-License-Identifier: GPL-3.0-or-later
"""Exports the evaluated objects of every frame by Blender's own exporters."""

import contextlib
import shutil

import bpy
import numpy as np
from mathutils import Matrix

from ..blender import mesh_arrays
from ..blender.actions import curves_of
from ..blender.evaluation import updated
from ..core.errors import UserError
from ..core.runtime.coroutines import Pause
from ..results import result_objects
from . import export_checks
from .caches import plain, size_text
from .frames import playing

OPERATORS = {"ABC": ("wm", "alembic_export"), "USD": ("wm", "usd_export"), "GLTF": ("export_scene", "gltf")}
MESHABLE = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
HELD = {"ABC": MESHABLE | {"CURVES"}, "USD": MESHABLE | {"CURVES", "POINTCLOUD"}, "GLTF": MESHABLE}  # kinds
SUFFIXES = {"ABC": ".abc", "USD": ".usdc", "GLTF": ".glb"}


def is_missing(kind):
    """Whether this Blender was built without the exporter, or its add-on is off."""
    group, name = OPERATORS[kind]
    return name not in dir(getattr(bpy.ops, group))


def write(context, kind, path, items, frames):
    """Coroutine: writes these objects' frames to a complete file, or none; UserError that names the file."""
    from arapfields._files import whole_file

    # USD's textures are found by paths relative to its own folder.
    with scene_kept(context), whole_file(path, beside=kind == "USD") as partial:
        with contextlib.ExitStack() as stack:
            shown = items
            if kind == "GLTF":
                shown = []
                for item in items:
                    shown.append(morphing := MorphingCopy(context, item))
                    stack.callback(morphing.discard)
                    yield from morphing.add(frames)
                shown = [morphing.item for morphing in shown]
            select(context, shown)
            require_room(context, path, items, frames)
            try:
                CALLS[kind](context, str(partial), frames)
            except RuntimeError as error:
                lines = [line for line in str(error).splitlines() if line]
                lines = [line for line in lines if not line.startswith("Location:")]
                reason = lines[-1].removeprefix("Error: ") if lines else ""
                raise UserError(
                    "{path}: Blender cannot write it ({reason})", path=path, reason=reason
                ) from error
        if not export_checks.is_whole(partial, kind):
            raise UserError("{path}: Blender could not write all of it; the disk may be full", path=path)


def require_room(context, path, items, frames):
    """UserError if the disk has too little space for the frames: Alembic's writer would crash Blender."""
    need, samples = 1e6, frames.count + (count_of("ABC", frames) if frames.step > 1 else 0)
    for item in items:
        mesh = item.evaluated_get(updated(context.view_layer)).data
        count = len(getattr(mesh, "vertices", ())) + len(getattr(mesh, "loops", ()))
        moving, still = 12 * count, 32 * count
        need += samples * moving + still
    free = shutil.disk_usage(path.parent).free
    if free < need:
        needs, has = size_text(need), size_text(free)
        raise UserError("{path}: it takes up to {needs}, and {has} are free", path=path, needs=needs, has=has)


def alembic(context, path, frames):
    samples = max(1, round(1 / frames.step))
    bpy.ops.wm.alembic_export(
        filepath=path,
        selected=True,
        start=int(frames.start),
        end=int(frames.last),
        xsamples=samples,
        gsamples=samples,
        as_background_job=False,
    )


def usd(context, path, frames):
    scene = context.scene
    before = scene.frame_start, scene.frame_end
    scene.frame_start, scene.frame_end = int(frames.start), int(frames.last)
    try:
        known = bpy.ops.wm.usd_export.get_rna_type().properties
        world = {"convert_world_material": False} if "convert_world_material" in known else {}
        bpy.ops.wm.usd_export(filepath=path, selected_objects_only=True, export_animation=True, **world)
    finally:
        scene.frame_start, scene.frame_end = before


def gltf(context, path, frames):
    bpy.ops.export_scene.gltf(
        filepath=path,
        export_format="GLB",
        use_selection=True,
        export_attributes=True,
        export_skins=False,
        export_morph=True,
        export_animations=True,
        export_animation_mode="ACTIVE_ACTIONS",  # one animation of all objects, not one each
        export_frame_range=False,
        export_force_sampling=False,
        export_optimize_animation_size=False,
    )


CALLS = {"ABC": alembic, "USD": usd, "GLTF": gltf}


def count_of(kind, frames):
    """How many frames a file of that kind holds."""
    return frames.count if kind == "GLTF" else int(frames.last) - int(frames.start) + 1


class MorphingCopy:
    """A copy of an object, with its motion, whose shape keys are the original's frames."""

    def __init__(self, context, item):
        self.context, self.source, self.item, self.action = context, item, None, None

    def add(self, frames):
        """Coroutine that plays the frames and adds their keys; then restores the scene's frame."""
        keys = []
        with playing(self.context.scene) as show:
            for number, frame in enumerate(frames):
                show(frame)
                keys.append(self.key(number, frame))
                yield Pause.REDRAW
        self.animate(keys, list(frames))

    def key(self, number, frame):
        depsgraph = updated(self.context.view_layer)
        evaluated = self.source.evaluated_get(depsgraph)
        world = evaluated.matrix_world.copy()
        if number == 0:
            mesh = bpy.data.meshes.new_from_object(
                evaluated, preserve_all_data_layers=True, depsgraph=depsgraph
            )
            self.item = bpy.data.objects.new(self.source.name, mesh)
            result_objects.look_like(self.source, self.item)
            self.context.scene.collection.objects.link(self.item)
            self.item.matrix_world = self.world = world
            points = mesh_arrays.positions(mesh)
            self.item.shape_key_add(name="Basis", from_mix=False)
        else:
            mesh = evaluated.to_mesh(preserve_all_data_layers=False, depsgraph=depsgraph)
            points = mesh_arrays.positions(mesh)
            evaluated.to_mesh_clear()
            if len(points) != len(self.item.data.vertices):
                raise UserError(
                    "{name} has another number of vertices at frame {frame}; glTF needs the same at all",
                    self.source,
                    frame=plain(frame),
                )
            moved = np.array(self.world.inverted_safe() @ world)
            if not np.allclose(moved, np.array(Matrix.Identity(4)), atol=1e-7):
                points = points @ moved[:3, :3].T + moved[:3, 3]
        key = self.item.shape_key_add(name=f"frame {plain(frame)}", from_mix=False)
        key.data.foreach_set("co", np.ascontiguousarray(points, dtype=np.float32).ravel())
        return key

    def animate(self, keys, frames):
        """Keyframes each key with 1 at its frame and 0 at the frames beside it, with linear interpolation."""
        for number, key in enumerate(keys):
            for at in range(max(0, number - 1), min(len(frames), number + 2)):
                key.value = float(at == number)
                key.keyframe_insert("value", frame=frames[at])
        self.action = self.item.data.shape_keys.animation_data.action
        for curve in curves_of(self.action):
            for point in curve.keyframe_points:
                point.interpolation = "LINEAR"

    def discard(self):
        mesh, action = self.item.data if self.item else None, self.action
        if self.item is not None:
            bpy.data.objects.remove(self.item)
            bpy.data.meshes.remove(mesh)
        if action is not None and action.users == 0:
            bpy.data.actions.remove(action)


@contextlib.contextmanager
def scene_kept(context):
    """Restores selection, active object and frame after the block: an exporter that fails leaves them
    changed."""
    layer, scene = context.view_layer, context.scene
    frame, subframe = scene.frame_current, scene.frame_subframe
    chosen, active = [item.name for item in context.selected_objects], layer.objects.active
    name = active.name if active else ""
    try:
        yield
    finally:
        for item in layer.objects:
            item.select_set(item.name in chosen)
        layer.objects.active = layer.objects.get(name)
        if (scene.frame_current, scene.frame_subframe) != (frame, subframe):
            scene.frame_set(frame, subframe=subframe)


def select(context, items):
    """Selects these objects alone; UserError if one is hidden, as exporters would leave it out."""
    for item in context.view_layer.objects:
        item.select_set(False)
    for item in items:
        if not item.visible_get():
            raise UserError("{name} is hidden; show it to export it", item)
        item.select_set(True)
    context.view_layer.objects.active = items[0]
