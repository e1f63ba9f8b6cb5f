# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender import mesh_arrays, modifier_stack
from ..blender.language import translated
from ..blender.object_references import settings_of
from ..blender.property_definitions import effective_value, effective_values
from ..blender.source_operator import SourceOperator
from ..core.errors import UserError
from ..core.runtime.jobs import Item
from ..core.settings.parameters import EXTRACTION
from ..field_modifier import layers, motion
from ..jobs.job_operator import JobOperator
from ..properties.choices import extraction, surface
from ..surface.source_surface import read_surface
from . import placement


class FieldOperator(SourceOperator):
    """Mixin: works on the field's modifier of the panel's source."""

    bl_options = {"REGISTER", "UNDO"}
    guide = "results"

    @classmethod
    def refuses(cls, source):
        if modifier_stack.top(source) is None:
            return UserError("{name} has no ARAP Fields modifier", source)
        if settings_of(source).live_kind:
            return UserError("{name} is live; end live mode first", source)
        return None


class ARAPFIELDS_OT_apply_as_shape_key(FieldOperator, bpy.types.Operator):
    """Turn the ARAP Fields modifier, as it acts now, into a shape key; Blender's own operator refuses it"""

    bl_label = "Apply as Shape Key"

    @classmethod
    def refuses(cls, source):
        return super().refuses(source) or placement.refusal(source, "WARP", "KEY")

    def change(self, context, source):
        layers.uncover(source, baked=True)
        with modifier_stack.evaluated_mesh(context, source, in_place=True) as mesh:
            before = mesh_arrays.positions(mesh)
        with modifier_stack.moved_mesh(context, source) as mesh:
            after = mesh_arrays.positions(mesh)
        placement.single_user(source)
        if source.data.shape_keys is None:
            source.shape_key_add(name="Basis", from_mix=False)
        placement.add_warp_key(source, before, after)
        motion.discard(source)
        layers.uncover(source)


class ARAPFIELDS_OT_remove_field(FieldOperator, bpy.types.Operator):
    """Take the ARAP Fields modifier away, with the motion that it carries"""

    bl_label = "Remove"

    def change(self, context, source):
        reason = placement.take_off(context, source)
        if reason is not None:
            self.report({"WARNING"}, translated(reason))


class ARAPFIELDS_OT_extract(JobOperator, bpy.types.Operator):
    """Make a mesh of the implicit surface itself, undeformed"""

    bl_label = "Extract Surface"
    bl_options = {"UNDO"}
    title = "Extract"
    guide = "results"

    __annotations__ = {"surface": surface(options={"SKIP_SAVE"}), **extraction(options={"SKIP_SAVE"})}

    def plan(self, context, source, _):
        settings = settings_of(source)
        shape = read_surface(context, source, exact=effective_value("surface", settings, self) == "EXACT")
        grid = effective_values(EXTRACTION, settings, self)

        def work(tracker):
            vertices, topology = shape.extract(tracker, 0.8, **grid)
            return shape.space.to_local(vertices), topology

        def apply(mesh):
            owner = shape.reference.get()
            report = {"resolution": grid["resolution"], "vertices": len(mesh[0]), "triangles": len(mesh[1])}
            item = placement.show(
                bpy.context, owner, "EXTRACT", "SURFACE", placement.surface_mesh(owner, *mesh), report
            )
            said = translated("{name} with {count} triangles", name=item.name, count=f"{len(mesh[1]):,}")
            return said + placement.hidden_note(placement.show_alone(owner, item))

        return Item(source.name, work, apply)


CLASSES = [ARAPFIELDS_OT_extract, ARAPFIELDS_OT_apply_as_shape_key, ARAPFIELDS_OT_remove_field]
