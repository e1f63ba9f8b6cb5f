# SPDX-License-Identifier: GPL-3.0-or-later
from dataclasses import replace

import bpy
import numpy as np

from ..blender.evaluation import world_matrix
from ..blender.host import has_window
from ..blender.language import about, translated
from ..blender.object_references import ObjectReference, settings_of
from ..blender.property_definitions import annotations, effective_value, effective_values, integer, options_of
from ..blender.source_operator import SourceOperator
from ..blender.user_preferences import preset_classes
from ..carried import carrying, rest_bones
from ..core.errors import UserError, refuse
from ..core.geometry.handles import nothing_held
from ..core.geometry.spaces import space_of
from ..core.runtime import native
from ..core.runtime.jobs import Item
from ..core.settings.parameters import WRAP
from ..deform.solve_job import SolveOperator, plan_solve_job
from ..field_modifier import layers
from ..handles import empties
from ..handles.held_counts import Followers
from ..jobs.job_operator import JobOperator
from ..properties.choices import result_properties
from ..results import placement
from ..results.placement import holds_place
from . import landmarks, transfer
from .matching import Match, Wrapped
from .properties import carried_kinds, fit_rig, groups, mix, move_object, onto


class ARAPFIELDS_OT_wrap(SolveOperator, bpy.types.Operator):
    """Lay the object onto another, as rigidly as possible; UVs, groups and shape keys come along"""

    bl_label = "Wrap"
    bl_options = {"UNDO"}
    title = "Wrap"
    guide = "wrap"

    __annotations__ = {
        **annotations(WRAP, options={"SKIP_SAVE"}),
        "onto": onto(),
        "fit_rig": fit_rig(options={"SKIP_SAVE"}),
        "move_object": move_object(options={"SKIP_SAVE"}),
        **result_properties(),
    }
    below = ()  # rest_bones.BeforeArmatures of each source

    @classmethod
    def refuses(cls, source):
        """Checks the settings' target only in the user interface: a script may name another one."""
        return super().refuses(source) or (landmarks.refusal(source) if has_window() else None)

    def clear_up(self, job):
        """Moves the field's modifier back to its place if the job has failed."""
        for below in self.below:
            below.give_back()
        SolveOperator.clear_up(self, job)

    def plan(self, context, source, weights):
        settings = settings_of(source)
        context.view_layer.update()
        values = effective_values(WRAP, settings.wrap, self)
        af = native.library()
        options = options_of("wrap", values)
        space = space_of(world_matrix(source), source.name)
        other = landmarks.target_of(source, self.onto)
        self.end_live(context, source, "WRAP")
        fitting, below = None, ()
        if (
            effective_value("fit_rig", settings.wrap, self)
            and self.in_place(source)
            and rest_bones.armatures_of(source)
        ):
            before = landmarks.world_vertices_at_rest(context, source)
            fitting = rest_bones.Fitting(source, space)
            below = [rest_bones.BeforeArmatures(one) for one in rest_bones.posed_with(source)]
            self.below = (*self.below, *below)
            pairs = landmarks.read(source, space, before, landmarks.world_vertices_at_rest(context, source))
        else:
            pairs = landmarks.read(source, space)
        vertices, triangles = landmarks.read_target(context, other, space)
        marks, wrapped = landmarks.Marks(source), Wrapped(source, other)

        def solve(tracker, rest, samples, weight):
            task = tracker.start("Wrapping", weight)
            field = af.wrap(samples, af.MeshSdf(vertices, triangles), pairs, options, task=task)
            marks.left_out = field.report.left_out
            tracker.warnings += [
                UserError("note: {text}", text=marks.numbered(text)) for text in field.report.notes
            ]
            if fitting is not None:
                fitting.move(field)
                tracker.warnings += fitting.warnings
            return field

        places = effective_value("move_object", settings.wrap, self) and not holds_place(source, other)
        item = plan_solve_job(context, self, source, "WRAP", values["samples"], values["seed"], solve, places)
        return self.with_rest(item, marks, wrapped, fitting, below, Followers(context, source))

    def with_rest(self, item, marks, wrapped, fitting, below, followers):
        """The item with an `apply` that also marks landmarks, and moves rest bones and handles."""

        def apply(solved):
            said, context, source = item.apply(solved), bpy.context, marks.source.get()
            marks.put()
            placement.show_landmarks(source, False)
            if self.in_place(source):
                wrapped.put()
            for one in below:
                one.kept = True
            if fitting is not None:
                carrying.follow(context, source, solved[0].carried, lambda: fitting.put(context))
            followers.follow(context, source)
            empty = empties.holding_nothing(source)
            self.warnings += [about(source.name, nothing_held(empty))] if empty else []
            return said

        return replace(item, apply=apply)


class ARAPFIELDS_OT_add_landmark(SourceOperator, bpy.types.Operator):
    """Add a pair of landmarks, at the places of both surfaces that are nearest to two locations"""

    bl_label = "Add Landmark"
    bl_options = {"REGISTER", "UNDO"}
    guide = "wrap"

    rest: bpy.props.FloatVectorProperty(
        name="Landmark", description="Place on the object, in the world", subtype="TRANSLATION"
    )
    on_target: bpy.props.FloatVectorProperty(
        name="On the Target", description="Place on the target, in the world", subtype="TRANSLATION"
    )

    def change(self, context, source):
        target = landmarks.target_of(source)
        landmarks.place(context, source, target, np.array(self.rest), np.array(self.on_target))


class ARAPFIELDS_OT_remove_landmark(SourceOperator, bpy.types.Operator):
    """Remove a pair of landmarks with its Empties"""

    bl_label = "Remove Landmark"
    bl_options = {"INTERNAL", "UNDO"}
    guide = "wrap"

    index: integer("Row", "Which of them, the first is 0", min=0)

    def change(self, context, source):
        if self.index < len(settings_of(source).wrap.landmarks):
            landmarks.remove(source, self.index)


class ARAPFIELDS_OT_mirror_landmarks(SourceOperator, bpy.types.Operator):
    """Add the pairs of landmarks again on the other side of both objects, across their X axes"""

    bl_label = "Mirror Landmarks"
    bl_options = {"REGISTER", "UNDO"}
    guide = "wrap"

    @classmethod
    def refuses(cls, source):
        return landmarks.refusal(source) or (
            None if landmarks.used(source) else UserError("No landmarks yet")
        )

    def change(self, context, source):
        count = landmarks.mirror(context, source)
        return translated("Pairs of landmarks added: {count}", count=count)


class ARAPFIELDS_OT_reset_bones(SourceOperator, bpy.types.Operator):
    """Put the bones at rest back to where they were before they were fitted to the wrapped shape"""

    bl_label = "Reset Bones"
    bl_options = {"UNDO"}
    guide = "wrap"

    @classmethod
    def refuses(cls, source):
        return None if rest_bones.fitted(source) else UserError("No bones were fitted to {name}", source)

    def change(self, context, source):
        shapes = carrying.present(context, source)
        carrying.follow(context, source, shapes, lambda: rest_bones.reset(context, source))


class ARAPFIELDS_OT_transfer(JobOperator, bpy.types.Operator):
    """Give the target what the wrapped object has: shape keys, weights, attributes, seams, its armature"""

    bl_label = "Transfer to Target"
    bl_options = {"UNDO"}
    title = "Transfer to Target"
    guide = "wrap"

    __annotations__ = {
        "onto": onto(),
        "transfer": carried_kinds(options={"SKIP_SAVE"}),
        "groups": groups(options={"SKIP_SAVE"}),
        "mix": mix(options={"SKIP_SAVE"}),
    }
    uncovered = ()  # ObjectReferences of sources whose wrap was a layer, until something is transferred

    @classmethod
    def refuses(cls, source):
        return (landmarks.refusal(source) if has_window() else None) or transfer.not_wrapped(source)

    def plan(self, context, source, weights):
        target = landmarks.target_of(source, self.onto)
        kinds = effective_value("transfer", settings_of(source).wrap, self)
        has_keys = "KEYS" in kinds and bool(transfer.keys_of(source))
        refuse(
            transfer.refusal(source, target) or (transfer.key_refusal(source, target) if has_keys else None)
        )
        if layers.uncover(source):
            self.uncovered = (*self.uncovered, ObjectReference(source))
        match = Match(context, source, target, has_keys)
        wrap = settings_of(source).wrap
        named = effective_value("groups", wrap, self) if "GROUPS" in kinds else ""
        mixed = transfer.groups_named(match.given.groups, named, source), effective_value("mix", wrap, self)

        def apply(_):
            work = transfer.Transfer(bpy.context, *match.get(), match, *mixed)
            done = work.carry(kinds)
            self.uncovered = tuple(one for one in self.uncovered if one.uid != match.ends[0].uid)
            return transfer.message(work.target, done, work.notes)

        return Item(source.name, match.find, apply, edits=match.ends)

    def clear_up(self, job):
        """Makes wraps layers again of which nothing was transferred."""
        for source in filter(None, (reference.find() for reference in self.uncovered)):
            if layers.can_stay(source):
                layers.cover(source)


CLASSES = [
    ARAPFIELDS_OT_wrap,
    ARAPFIELDS_OT_transfer,
    ARAPFIELDS_OT_reset_bones,
    ARAPFIELDS_OT_add_landmark,
    ARAPFIELDS_OT_remove_landmark,
    ARAPFIELDS_OT_mirror_landmarks,
    *preset_classes("wrap", "Wrap", WRAP),
]
