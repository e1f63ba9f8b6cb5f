# SPDX-License-Identifier: GPL-3.0-or-later
"""Skinning: settings of the armature, the operator, the panel."""

import bpy
import numpy as np

from ..blender.language import translated
from ..blender.object_references import ObjectReference, settings_of, source_of
from ..blender.property_definitions import annotations, choice, effective_value, effective_values, options_of
from ..blender.section import Advanced, Section, draw_settings, job_button, note, settings_column
from ..core.errors import UserError, refuse
from ..core.runtime import native
from ..core.runtime.jobs import Item, Pause
from ..core.settings.choices import SKINNED
from ..core.settings.parameters import SKIN
from ..jobs.job_operator import JobOperator, busy
from ..names import Op
from . import writing
from .properties import groups


class ARAPFIELDS_OT_skin(JobOperator, bpy.types.Operator):
    """Give the selected meshes weights of the armature's bones, by what poses of the field look like"""

    bl_label = "Skin to Armature"
    bl_options = {"UNDO"}
    title = "Skin to Armature"
    guide = "characters"

    __annotations__ = {
        "scope": choice(SKINNED, "Objects", "Which objects to work on", options={"SKIP_SAVE"}),
        "groups": groups(options={"SKIP_SAVE"}),
        **annotations(SKIN, options={"SKIP_SAVE"}),
    }

    @classmethod
    def obstacle(cls, context):
        rig = writing.rig_of(context)
        meshes = writing.meshes_of(context, rig, "COLLECTION") if rig else []
        chosen = writing.meshes_of(context, rig, "SELECTED") if rig else []
        return native.problem() or busy() or writing.refusal(rig, chosen or meshes)

    def prepare(self, context, job):
        """Coroutine: the one item of the job, of all meshes together."""
        try:
            return [self.plan_all(context)]
        except (UserError, ValueError) as error:
            self.failures.append(translated(error))
            return []
        finally:
            yield Pause.REDRAW

    def plan_all(self, context):
        context.view_layer.update()
        rig = writing.rig_of(context)
        meshes = writing.meshes_of(context, rig, self.scope) if rig else []
        refuse(writing.refusal(rig, meshes))
        settings = settings_of(rig).skin
        values = effective_values(SKIN, settings, self)
        kept_groups = effective_value("groups", settings, self)
        af, options = native.library(), options_of("skin", values)
        with writing.at_rest(context, rig):
            read = [writing.read(context, item, rig, kept_groups) for item in meshes]
        bones = writing.bones_of(af, rig)
        names = [bone.name for bone in bones]
        vertices, triangles, firsts = writing.join(read)
        painted = writing.joined_stiffness(read)
        reference, rest = ObjectReference(rig), writing.rest_of(rig)

        def work(tracker):
            share = 0.4 if options.correctives else 1.0
            task = tracker.start("Posing", share)
            stiff, bend = painted
            weights = af.skin_weights(
                (vertices, triangles), bones, options, weights=stiff, bend_weights=bend, task=task
            )
            own = []
            for shape, first in zip(read, firsts, strict=False):
                rows = slice(first, first + len(shape.vertices))
                points = shape.own(shape.vertices)
                own.append(
                    writing.fill_up(shape.own(weights[rows]), shape.kept, names, options.influences, points)
                )
                if shape.nearest is None:
                    weights[rows] = own[-1]
            if not options.correctives:
                return own, []
            task = tracker.start("Correctives", 1.0)
            return own, af.skin_correctives(
                vertices, triangles, bones, weights, options, stiffness=stiff, bend_weights=bend, task=task
            )

        def apply(solved):
            weights, correctives = solved
            armature = reference.get()
            if writing.rest_of(armature) != rest:
                raise UserError("{name} changed while it was worked on; run again", armature)
            with writing.at_rest(bpy.context, armature):
                items = [shape.get(armature) for shape in read]
            for item, shape, own, first in zip(items, read, weights, firsts, strict=False):
                writing.write_weights(item, names, own, shape.kept)
                writing.remove_correctives(item)
                writing.follow(item, armature)
                rows = slice(first, first + len(own))
                if not writing.takes_correctives(item, shape):
                    if correctives:
                        self.warnings.append(
                            translated(
                                UserError("{name} takes no correctives: its vertices are not its own", item)
                            )
                        )
                elif correctives:
                    writing.add_correctives(item, armature, shape, rows, correctives, names)
            moves = np.any([np.asarray(own).max(axis=0) > 0 for own in weights], axis=0)
            self.name_idle(bones, moves, af.coincident_bones(bones))
            return translated("{count} bones move {meshes}", count=int(moves.sum()), meshes=names_of(items))

        return Item(rig.name, work, apply, edits=(reference, *(shape.reference for shape in read)))

    def name_idle(self, bones, moves, coincident):
        """Warns of the deforming bones without weights."""
        passed = [bones[index].name for index, _ in coincident if not moves[index]]
        idle = [bone.name for bone, used in zip(bones, moves, strict=True) if bone.deform and not used]
        outside = [name for name in idle if name not in passed]
        if passed:
            self.warnings.append(
                translated("Passed over, since others lie there: {bones}", bones=", ".join(passed))
            )
        if outside:
            self.warnings.append(translated("No vertex follows {bones}", bones=", ".join(outside)))


def names_of(items):
    return ", ".join(item.name for item in items)


class ARAPFIELDS_PT_skin(Section, bpy.types.Panel):
    bl_label = "Skin"
    bl_order = 5
    tasks = frozenset({"RIG"})
    needs_source = False

    @classmethod
    def poll(cls, context):
        wanted = writing.rig_of(context) is not None or source_of(context) is not None
        return super().poll(context) and wanted

    def fill(self, context, source, settings):
        layout, rig = self.layout, writing.rig_of(context)
        meshes = writing.meshes_of(context, rig, "SELECTED") if rig else []
        if rig is not None:
            group = settings_of(rig).skin
            settings_column(layout, group, SKIN, advanced=False)
            draw_settings(layout, group, "groups")
        job_button(layout, Op.SKIN, "MOD_ARMATURE")
        note(layout, writing.refusal(rig, meshes))


class ARAPFIELDS_PT_skin_settings(Advanced, bpy.types.Panel):
    bl_label = "Skin Settings"
    bl_order = 4
    tasks = frozenset({"RIG"})
    needs_source = False

    @classmethod
    def poll(cls, context):
        return super().poll(context) and writing.rig_of(context) is not None

    def fill(self, context, source, settings):
        settings_column(self.layout, settings_of(writing.rig_of(context)).skin, SKIN, advanced=True)


CLASSES = [
    ARAPFIELDS_OT_skin,
    ARAPFIELDS_PT_skin,
    ARAPFIELDS_PT_skin_settings,
]
