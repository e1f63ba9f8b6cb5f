# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..blender import modifier_stack
from ..blender.language import translated
from ..blender.object_references import owner_of
from ..blender.source_operator import SourceOperator
from ..carried import carried_objects, refusals
from ..core.errors import UserError, refuse
from ..field_modifier import inputs
from ..field_nodes import helper, node_group
from ..live import sessions
from ..names import FIELD_NODES
from ..poses import applying


class ARAPFIELDS_OT_field_as_nodes(SourceOperator, bpy.types.Operator):
    """Have the other selected objects move by this one's field, by nodes that need no extension: instances, \
curves and what changes its topology as well. They follow each further solve"""

    bl_label = "Field as Nodes"
    bl_options = {"REGISTER", "UNDO"}
    guide = "characters"

    def change(self, context, source):
        others = [item for item in context.selected_objects if item != source and owner_of(item) != source]
        if not others and helper.of(source) is None:
            raise UserError("Select the objects to move by nodes as well")
        for item in others:
            require_free(source, item)
        is_live, rows = sessions.is_live(source), None
        if not is_live:
            pose = applying.solved_pose(context, source)
            rows = helper.rows_of(pose.field, pose.local_to_solve)
        carrier = helper.of(source) or helper.make(source)
        for item in others:
            follow(item, carrier)
        if is_live:
            sessions.settle(context, source.session_uid)
        else:
            helper.write(carrier, rows)
        count = len(bpy.data.user_map(subset=[carrier])[carrier] - {source})
        return translated("Objects that move by the field of {name}: {count}", count=count, name=source.name)


def require_free(source, item):
    """Raises UserError if an object cannot have the modifier, or moves with the source already."""
    if item.library is not None:
        raise UserError("{name} is linked from another file; make it local to carry it", item)
    if not hasattr(item.data, "attributes") and item.type not in ("CURVE", "FONT", "SURFACE"):
        raise UserError("{name} has no geometry that nodes could move", item)
    refuse(refusals.of_splats(item))
    if carried_objects.find(source, item) is not None:
        raise UserError("{name} moves with {other} already", item, other=source.name)


def follow(item, carrier):
    """Adds the modifier to an object that does not have it."""
    if any(is_following(modifier, carrier) for modifier in item.modifiers):
        return
    index = modifier_stack.end(list(item.modifiers))
    modifier = item.modifiers.new("ARAP Field", "NODES")
    modifier.node_group = node_group.find_or_make()
    inputs.put(modifier, "Field", carrier)
    item.modifiers.move(item.modifiers.find(modifier.name), index)


def is_following(modifier, carrier):
    return (
        modifier.type == "NODES"
        and FIELD_NODES in (modifier.node_group or ())
        and inputs.get(modifier, "Field") == carrier
    )


CLASSES = [ARAPFIELDS_OT_field_as_nodes]
