# SPDX-License-Identifier: GPL-3.0-or-later
"""Exports of the evaluated objects of every frame by Blender's own exporters."""

import contextlib
import shutil
import tempfile
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from ..blender import mesh_arrays
from ..blender.evaluation import curves_of, updated
from ..blender.host import has_window
from ..blender.language import about, translated
from ..blender.object_references import ObjectReference, settings_of, source_of
from ..blender.property_definitions import choice, path_text, text
from ..blender.splat_layouts import holds_splats
from ..core import files
from ..core.errors import UserError
from ..core.runtime.jobs import Item, Pause
from ..core.settings.choices import EXPORT_FORMATS
from ..field_modifier import cache_modifier
from ..names import CONTEXT, Op
from ..results import placement
from ..solver import frame_range
from ..solver.frame_range import playing
from . import caches
from .bake_job import BakeOperator, arguments, effective_kind, refusal_of
from .caches import plain, size_text
from .object_bake import ObjectBake
from .properties import settings

# Exports the evaluated objects of every frame by Blender's own exporters.

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
        if not files.is_whole_animation(partial, kind):
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
            placement.look_like(self.source, self.item)
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


LABELS = {kind: label for kind, label, _ in EXPORT_FORMATS}


class ARAPFIELDS_OT_export_animation(BakeOperator, bpy.types.Operator):
    """Write what the object does, frame by frame, to a file that other programs read"""

    bl_label = "Export Animation"
    bl_options = set()
    title = "Export"
    folder = None  # of the caches that are played while the exporter runs
    output_folder = None  # of the file
    guide = "animation"
    used = ("kind", "range", "step", "subframes", "loop")

    __annotations__ = {
        **{name: one for name, one in settings(options={"SKIP_SAVE"}).items() if not name.endswith("format")},
        "format": choice(EXPORT_FORMATS, "Format", "What kind of file", options={"SKIP_SAVE"}),
        "filepath": path_text(
            "File",
            "Where it goes; empty for a file with the object's name beside the .blend",
            "FILE",
            options={"SKIP_SAVE"},
        ),
        "filter_glob": text("Filter", "Files that are shown", options={"HIDDEN", "SKIP_SAVE"}),
    }

    asked = False  # whether a file was chosen in the dialog

    def invoke(self, context, event):
        """Opens the file browser if no path is given; then runs as from a script."""
        if self.filepath or not has_window():
            return super().invoke(context, event)
        suffix = SUFFIXES[self.format]
        folder = Path(bpy.path.abspath("//"))
        name = caches.file_name(source_of(context), context.scene, folder)
        self.filepath = str(folder / f"{name}{suffix}")
        self.filter_glob, self.asked = f"*{suffix}", True
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        if not self.asked:
            return super().execute(context)
        bpy.ops.arapfields.export_animation("INVOKE_DEFAULT", **arguments(self))
        return {"FINISHED"}

    def cancel(self, context):
        """Called if no file was chosen, or if the job's window closes."""
        if not self.asked:
            super().cancel(context)

    @classmethod
    def refuses(cls, source):
        """An object that plays a cache is exported as it is; others are solved first."""
        if holds_splats(source):
            return UserError("{name} holds splats; Export Splats and Bake Animation write them", source)
        return None if cache_modifier.is_playing(source) else super().refuses(source)

    def places(self, context):
        suffix = SUFFIXES[self.format]
        return {caches.cache_path(source_of(context), context.scene, suffix, "//", self.filepath): False}

    def plan_frames(self, context, job):
        if is_missing(self.format):
            name = LABELS[self.format]
            raise UserError("This Blender has no exporter for {format}, or its add-on is off", format=name)
        active, sources = source_of(context), self.sources(context)
        (path,) = self.places(context)
        kinds = [(source, effective_kind(source, self)) for source in sources]
        self.frames = frame_range.choose_frames(context, kinds, self.values(active))
        self.items = [ObjectReference(source) for source in sources]
        unsolved = [source for source in sources if self.is_unsolved(source)]
        return (yield from self.plan(context, job, path, unsolved))

    def is_unsolved(self, source):
        """Whether a source must be solved first; UserError if its cache does not fit it."""
        if not cache_modifier.is_playing(source):
            return refusal_of(source, effective_kind(source, self)) is None
        reason = caches.problem(source, look_closely=True)
        if reason is not None:
            raise reason
        return False

    def plan(self, context, job, path, unsolved):
        self.output_folder = caches.OutputFolder(path.parent)
        self.output_folder.make()
        names = ", ".join(reference.name for reference in self.items)
        if not unsolved:
            return [Item(names, lambda _: None, lambda _: self.export(context, job, path))]
        self.folder = Path(tempfile.mkdtemp(prefix=f".{path.stem}-frames-", dir=path.parent))

        def make(source, kind, chosen):
            return ObjectBake(context, source, kind, chosen, self.folder / f"{source.session_uid}.pc2")

        kinds = [(source, effective_kind(source, self)) for source in unsolved]
        items = yield from self.begin(context, job, kinds, self.values(unsolved[0]), make)
        if not items or self.failures:
            raise UserError("{error}", error=self.failures.pop())
        return [Item(names, items[0].work, lambda _: self.export(context, job, path))]

    def export(self, context, job, path):
        """Coroutine: plays the solved caches while the exporter runs, then restores the objects."""
        with contextlib.ExitStack() as stack:
            shown = {reference.uid: reference.get() for reference in self.items}
            riders, unbaked, solved = [], [], set()
            for bake in self.frames_pass.bakes if self.frames_pass is not None else ():
                if bake.error is not None:
                    raise bake.error
                solved.add(bake.reference.uid)
                yield from bake.carried.read_keyframes(context, bake.reference.get(), job)
                shown[bake.reference.uid] = self.play(context, bake, stack)
                lent, left = bake.carried.lend(context, bake.reference.get(), stack)
                riders, unbaked = riders + lent, unbaked + left
                self.failures += [
                    about(bake.name, reason) for reason in bake.carried.carrying.take_warnings()
                ]
            for reference in self.items:
                if reference.uid not in solved:  # it and what it carries play their bakes
                    entries = settings_of(reference.get()).carried
                    riders += [entry.item for entry in entries if entry.item is not None]
            items = [*shown.values(), *(item for item in dict.fromkeys(riders) if item not in shown.values())]
            held = [item for item in items if item in shown.values() or self.holds(item)]
            self.tell_of(unbaked, [item.name for item in items if item not in held and item.type != "EMPTY"])
            yield from write(context, self.format, path, held, self.frames)
        values = {
            "count": count_of(self.format, self.frames),
            "path": path.name,
            "size": caches.size_text(path.stat().st_size),
        }
        if len(held) == 1:
            return translated("{count} frames exported to {path} ({size})", **values)
        return translated(
            "{count} frames of {objects} objects exported to {path} ({size})", objects=len(held), **values
        )

    def holds(self, item):
        """Whether the file holds a carried object: exporters leave out what is hidden, and some kinds."""
        return item.visible_get() and item.type in HELD[self.format]

    def tell_of(self, unbaked, left_out):
        """Warns of carried objects that are not in the file."""
        if unbaked:
            names = ", ".join(unbaked)
            self.warnings.append(translated("{names} is not in the file; bake, then export", names=names))
        if left_out:
            self.warnings.append(
                translated(
                    "{names} is not in the file: it is hidden, or {format} holds none of its kind",
                    names=", ".join(left_out),
                    format=LABELS[self.format],
                )
            )

    def play(self, context, bake, stack):
        """The object that plays a bake until the ExitStack is closed."""
        source = bake.unchanged_source()
        bake.store.commit()
        player = source
        if bake.in_place:
            stack.callback(cache_modifier.restore, source, cache_modifier.snapshot(source))
        else:
            player = bpy.data.objects.new(f"{source.name}_baked", bake.mesh(context, source))
            context.scene.collection.objects.link(player)
            stack.callback(placement.discard, player)
            placement.look_like(source, player)
            placement.place(context, source, player)
        bake.store.play_on(player)
        return player

    def clear_up(self, job):
        super().clear_up(job)
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)
        if self.output_folder is not None:
            self.output_folder.remove_if_unused()


class ARAPFIELDS_MT_export(bpy.types.Menu):
    """Write what the object does, frame by frame, to a file that other programs read"""

    bl_label = "Export Animation"
    bl_translation_context = CONTEXT

    def draw(self, context):
        for kind, label in LABELS.items():
            row, missing = self.layout.row(), is_missing(kind)
            row.enabled = not missing
            text = translated("{format} (not in this Blender)", format=label) if missing else label
            row.operator(Op.EXPORT, text=text).format = kind


CLASSES = [
    ARAPFIELDS_OT_export_animation,
    ARAPFIELDS_MT_export,
]
