# SPDX-License-Identifier: GPL-3.0-or-later
"""UserErrors that say why an object is not carried."""

from ..blender.evaluation import with_ancestors
from ..blender.modifier_stack import handle_rigs, is_posing
from ..blender.object_references import in_scene, settings_of
from ..blender.splat_layouts import holds_splats
from ..core.errors import UserError
from .rest_bones import above_field
from .world_matrices import constrained_to

BINDING = {"LATTICE": "object", "CURVE": "object", "HOOK": "object"}  # modifiers that follow another object
BINDING |= {"MESH_DEFORM": "object", "SURFACE_DEFORM": "target"}


def bound_to(item):
    """The objects that shown modifiers of an object have it follow, None among them."""
    shown = [modifier for modifier in item.modifiers if modifier.show_viewport]
    return [getattr(modifier, BINDING[modifier.type]) for modifier in shown if modifier.type in BINDING]


def of_entry(source, entry):
    """UserError that says why an entry of a source's list is left out now; else None."""
    item = entry.item
    if not in_scene(item):
        return UserError("{name}, which {source} carries, was deleted", entry, source=source.name)
    reason = of_item(source, item)
    if reason is not None:
        return reason
    if item.mode == "EDIT":
        return UserError("{name} is in Edit Mode; leave it first", item)
    if not item.visible_get():
        return UserError("{name} is hidden; it is not carried", item)
    return None


def of_item(source, item):
    """UserError that says why an object cannot be carried at all; else None."""
    if item == source:
        return UserError("{name} cannot carry itself", item)
    if item.library is not None:
        return UserError("{name} is linked from another file; make it local to carry it", item)
    settings = settings_of(item)
    if len(settings.handles):
        return UserError("{name} has handles of its own; it is not carried", item)
    if reason := of_splats(item):
        return reason
    if settings.handle_of == source and any(e.empty == item for e in settings_of(source).handles):
        return UserError("{name} is a handle of {source} itself", item, source=source.name)
    rigs = handle_rigs(source)
    if item in rigs:
        return UserError("The bones of {name} are handles of {source}", item, source=source.name)
    if moves(item, source):
        return UserError("{name} moves {source} already; it is not carried", item, source=source.name)
    if constrained_to(item, [*rigs, *above_field(source)]):
        return UserError("{name} follows the armature by a constraint; it is not carried", item)
    return moves_anyway(source, item)


def of_splats(item):
    """UserError if an object holds splats, which another object's field cannot move; else None."""
    return (
        UserError("{name} holds splats; only handles of its own turn them", item)
        if holds_splats(item)
        else None
    )


def moves_anyway(source, item):
    """UserError if an object already follows another one that the field moves; else None."""
    carried = [entry.item for entry in settings_of(source).carried if entry.item not in (None, item)]
    for parent in with_ancestors(item.parent):
        if parent in carried and is_moved_whole(source, parent):
            return moves_with(item, parent)
    for target in bound_to(item):
        if target is not None and target in [source, *carried]:
            return moves_with(item, target)
    return None


def moves(item, source):
    """Whether an object moves the source: what the field does to it would reach the source once more."""
    posing = [one.object for one in source.modifiers if is_posing(source, one) and one.show_viewport]
    above = [*with_ancestors(source.parent), *posing, *bound_to(source)]
    return item in above or constrained_to(source, [item])


def is_moved_whole(source, item):
    """Whether a carried object moves as a whole, with all of its children."""
    way = next(entry.way for entry in settings_of(source).carried if entry.item == item)
    return way == "RIGID" or item.type not in POINTWISE


def moves_with(item, other):
    return UserError("{name} moves with {other} already", item, other=other.name)


POINTWISE = {"MESH", "CURVES", "POINTCLOUD", "GREASEPENCIL", "CURVE", "SURFACE", "LATTICE", "ARMATURE"}
