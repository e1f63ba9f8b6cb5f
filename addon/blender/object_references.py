# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects and scenes across ticks of a job, by session_uid, and the selection that lists of them follow."""

import contextlib

import bpy

from ..core.errors import UserError
from ..names import PROPERTY
from .references import takes_references
from .splat_layouts import holds_splats

# References to objects and scenes across ticks of a job, by session_uid: Python's become invalid.

# References to objects across ticks of a job, by session_uid: Python references become invalid.


class ObjectReference:
    """Refers to an object while a job runs; the object may be renamed, undone or deleted meanwhile."""

    def __init__(self, item):
        self.name, self.uid = item.name, item.session_uid

    def get(self):
        """The object; UserError if it is in no scene any more."""
        item = self.find()
        if not in_scene(item):
            raise UserError("{name} was deleted while it was worked on", self)
        return item

    def find(self):
        """The object, even if it is in no scene; else None."""
        named = bpy.data.objects.get(self.name)
        if named is not None and named.session_uid == self.uid:
            return named
        return next((item for item in bpy.data.objects if item.session_uid == self.uid), None)


def in_scene(item):
    """Whether an object is in a scene: a deleted one stays in the file while anything points to it. The test
    is fast for visible objects; others are searched in the scenes."""
    return item is not None and (item.visible_get() or any(holds(scene, item) for scene in bpy.data.scenes))


def holds(scene, item):
    same_name = scene.objects.get(item.name)
    return same_name == item or (same_name is not None and item in scene.objects[:])


def settings_of(item):
    return getattr(item, PROPERTY)


def owner_of(item):
    """The source of a handle or a result; None for others, or if the source was deleted."""
    settings = settings_of(item)
    owner = settings.handle_of or (maker_of(item, settings.made_from) if settings.made_from else None)
    if owner is None and item.type == "EMPTY" and not takes_references(item):
        owner = next((one for one in bpy.data.objects if has_handle(one, item)), None)
    return owner if in_scene(owner) else None


def has_handle(source, empty):
    """Whether an Empty is in the source's list of handles."""
    return any(entry.empty == empty for entry in settings_of(source).handles)


def maker_of(item, name):
    """The source that lists this result: the object called `name` if there is one, else searched; or None.

    A result has no pointer to its source, as appending the result would then append the source.
    """
    named = bpy.data.objects.get(name)
    among = bpy.data.objects if named is None else [named]
    return next((other for other in among if lists(other, item)), None)


def lists(source, item):
    return any(entry.item == item for entry in settings_of(source).results)


def results_of(source):
    """The entries of a source's results; a duplicate's list has those of its original, which are left out."""
    return [entry for entry in settings_of(source).results if is_own_result(source, entry.item)]


def is_own_result(source, item):
    if item is None:
        return False
    named = bpy.data.objects.get(settings_of(item).made_from)
    return named in (None, source) or not lists(named, item)


def in_view(context):
    """The objects of the view layer. After undo Blender 5.2 may list None in place of one that is gone."""
    return [item for item in context.view_layer.objects if item is not None]


def is_source(item):
    """Whether an object can be a source: a mesh, or a point cloud of splats."""
    return item.type == "MESH" or holds_splats(item)


def active_of(context):
    """The active object, or None: the one that a script's temp_override() names before the view layer's."""
    window, given = context.window, getattr(context, "active_object", None)
    if window is not None and given not in (None, window.view_layer.objects.active):
        return given
    return context.view_layer.objects.active if context.view_layer else None


def active_uids(context):
    """{session_uid} of the active object and of the source whose panel it shows."""
    return {one.session_uid for one in (source_of(context), active_of(context)) if one is not None}


def source_of(context):
    """The object that the panel and the operators work on, or None.

    The active object when it is a source; the owner of the active handle or result.
    """
    active = active_of(context)
    if active is None:
        return None
    owner = owner_of(active)
    if active.type == "EMPTY" and owner is None:
        chosen = [item for item in context.selected_objects if is_source(item)]
        return chosen[0] if len(chosen) == 1 else None
    if active.type == "ARMATURE":
        return posed_by(active, context)
    if active.type != "EMPTY" and not is_source(active):
        return None
    return owner or active


def posed_by(rig, context):
    """The source of an active armature: the one selected with it, else one that it poses."""
    selected = [item for item in context.selected_objects if is_source(item)]
    if selected:
        return selected[0] if len(selected) == 1 else None
    meshes = [item for item in in_view(context) if is_source(item)]
    held = [item for item in meshes if any(entry.rig == rig for entry in settings_of(item).handles)]
    posed = [m for m in meshes if any(s.type == "ARMATURE" and s.object == rig for s in m.modifiers)]
    return next(iter(held), posed[0] if len(posed) == 1 else None)


def refusal(item, in_edit_mode=False):
    """UserError that says why an object cannot be a source now; else None."""
    if item is None:
        return UserError("Select a mesh object")
    if not is_source(item):
        return UserError("{name} is not a mesh object", item)
    if item.override_library is not None:
        return UserError("{name} is a library override; make it local first", item)
    if item.mode == "EDIT" and not in_edit_mode:
        return UserError("{name} is in Edit Mode; leave it first", item)
    return None


def refusal_of_linked(item):
    """UserError if an object is linked from another file, which cannot store results; else None."""
    if item.library is not None:
        return UserError("{name} is linked from another file; make it local first", item)
    return None


# Reference to a job's scene across its ticks: the window may switch scenes, or the scene may be deleted.


class SceneReference:
    """Refers to the context's scene and view layer, on which evaluation and visibility depend."""

    def __init__(self, context):
        self.name, self.uid = context.scene.name, context.scene.session_uid
        self.layer = context.view_layer.name

    def missed(self, context):
        """The name of the scene or view layer that the window no longer shows, or ""; UserError if the scene
        was deleted."""
        if context.scene.session_uid == self.uid:
            is_other = context.view_layer.name != self.layer and self.layer in context.scene.view_layers
            return self.layer if is_other else ""
        scene = next((scene for scene in bpy.data.scenes if scene.session_uid == self.uid), None)
        if scene is None:
            raise UserError("{name} was deleted while it was worked on", self)
        return scene.name


# Selection of objects, synchronized with active rows of lists.


class Rows:
    """`quiet`: the add-on itself sets the active row; update callbacks then select nothing."""

    quiet = False


rows = Rows()


def select_alone(context, item, extend=False):
    """Makes an object active and selected, alone unless `extend`; does nothing if it is hidden."""
    layer = context.view_layer
    if context.mode != "OBJECT" or layer.objects.get(item.name) != item or not item.visible_get():
        return
    for other in () if extend else context.selected_objects:
        other.select_set(False)
    item.select_set(True)
    layer.objects.active = item


@contextlib.contextmanager
def quietly():
    """Context manager: active rows set within it select nothing."""
    before, rows.quiet = rows.quiet, True
    try:
        yield
    finally:
        rows.quiet = before


def choose_row(settings, index):
    """Sets the active row of the handles; the selection of objects stays."""
    with quietly():
        settings.active_handle = index


def row_chosen(settings, context):
    """Update callback of the active handle: selects its Empty."""
    handles = settings.handles
    if not rows.quiet and 0 <= settings.active_handle < len(handles):
        empty = handles[settings.active_handle].empty
        if empty is not None:
            select_alone(context, empty)
