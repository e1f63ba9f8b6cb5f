# SPDX-License-Identifier: GPL-3.0-or-later
import contextlib
import shutil
import tempfile
from pathlib import Path

import bpy

from ..blender.host import has_window
from ..blender.language import about, translated
from ..blender.object_references import ObjectReference, settings_of, source_of
from ..blender.property_definitions import choice, path_text, text
from ..blender.splat_layouts import holds_splats
from ..core.errors import UserError
from ..core.runtime.jobs import Item
from ..core.settings.choices import EXPORT_FORMATS
from ..field_modifier import cache_modifier
from ..names import CONTEXT, Op
from ..results import result_objects
from . import caches, exporters, frames, played
from .bake_operator import BakeOperator, arguments, effective_kind, refusal_of
from .object_bake import ObjectBake
from .properties import settings

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
        suffix = exporters.SUFFIXES[self.format]
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
        suffix = exporters.SUFFIXES[self.format]
        return {caches.cache_path(source_of(context), context.scene, suffix, "//", self.filepath): False}

    def plan_frames(self, context, job):
        if exporters.is_missing(self.format):
            name = LABELS[self.format]
            raise UserError("This Blender has no exporter for {format}, or its add-on is off", format=name)
        active, sources = source_of(context), self.sources(context)
        (path,) = self.places(context)
        kinds = [(source, effective_kind(source, self)) for source in sources]
        self.frames = frames.choose(context, kinds, self.values(active))
        self.items = [ObjectReference(source) for source in sources]
        unsolved = [source for source in sources if self.is_unsolved(source)]
        return (yield from self.plan(context, job, path, unsolved))

    def is_unsolved(self, source):
        """Whether a source must be solved first; UserError if its cache does not fit it."""
        if not cache_modifier.is_playing(source):
            return refusal_of(source, effective_kind(source, self)) is None
        reason = played.problem(source, look_closely=True)
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
            yield from exporters.write(context, self.format, path, held, self.frames)
        values = {
            "count": exporters.count_of(self.format, self.frames),
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
        return item.visible_get() and item.type in exporters.HELD[self.format]

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
            stack.callback(result_objects.discard, player)
            result_objects.look_like(source, player)
            result_objects.place(context, source, player)
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
            row, missing = self.layout.row(), exporters.is_missing(kind)
            row.enabled = not missing
            text = translated("{format} (not in this Blender)", format=label) if missing else label
            row.operator(Op.EXPORT, text=text).format = kind


CLASSES = [ARAPFIELDS_OT_export_animation, ARAPFIELDS_MT_export]
