# SPDX-License-Identifier: GPL-3.0-or-later
"""Every identifier that Blender or a script sees, in one place."""

from enum import StrEnum

PACKAGE = __package__
TOOL = "arapfields.pin"  # in the toolbar
CATEGORY = "ARAP Fields"  # tab of the sidebar
RESULTS = "ARAP Fields"  # collection that holds results
HANDLES = "ARAP Handles"  # collection of the Empties that the extension makes for handles
HANDLES_MARK = "arapfields_handles"  # custom property of these collections
CONTEXT = "ARAP Fields"  # of our texts' translations, which Blender's own would replace otherwise
PROPERTY = "arapfields"  # object.arapfields
BONE_NUMBER = "arapfields_number"  # of a bone that is a handle; it stays where the bone is renamed
REPORT = "arapfields_report"  # custom property of results: figures as JSON
CORRECTIVE = "ARAP Corrective "  # how names of shape keys begin that go with skin weights
NEUTRAL_KEY = "ARAP Neutral"  # shape key that takes back the values that a wrap was made with
WARP_KEY = "ARAP Fields"  # shape key that carries the motion
FIELD_MODIFIER = "ARAP Fields"  # modifier that carries the motion, and its node group
SHAPE_OF = "arapfields_shape_of"  # custom property of the mesh that carries a live motion: what that is of
OFFSETS = "ARAP Fields"  # point attribute of the motion: an offset in the object's coordinates
TURNS = "ARAP Fields Turns"  # and how free custom normals turn: axis · angle
CHANGES = "ARAP Fields: "  # how names of attributes begin that say what is added to one of a splat
CACHE_MODIFIER = "ARAP Fields Cache"  # Blender's Mesh Cache modifier that plays a bake
FIELD_GROUP = "arapfields_group"  # custom property of that modifier's node groups: which, and its version
LAYER_GROUP = "arapfields_layer"  # of node groups of results below: version, kind, number, normals
FIELD_NODES = "arapfields_nodes"  # custom property of the node group that evaluates a field: its version
RESULT_SUFFIX = {
    "DEFORM": "_deformed",
    "STYLIZE": "_stylized",
    "EXTRACT": "_implicit",
    "LIVE": "_live",
    "BAKE": "_baked",
    "WRAP": "_wrapped",
}
PLAYED_GROUP = "arapfields_played"  # custom property of the node group that plays baked points
PLAYED_SUFFIX = "_played"  # of the mesh that has baked points of hair, point clouds and Grease Pencil
ROWS = "ARAP Fields Rows"  # point attribute: which of these points each is
FIELD_SUFFIX = "_field"  # of the mesh whose vertices are the numbers of a field
COPY_OF = "arapfields_copy_of"  # custom property of what was copied for a target: the carried object's name
HELPER_SUFFIX = "_offsets"  # of the mesh that carries offsets where the source cannot


class Op(StrEnum):
    """Operators, as in bpy.ops."""

    FIT = "arapfields.fit"
    ADD_HANDLE = "arapfields.add_handle"
    ADD_BONES = "arapfields.add_bones"
    SET_REST = "arapfields.set_rest"
    RESET_HANDLE = "arapfields.reset_handle"
    KEY_HANDLE = "arapfields.key_handle"
    REMOVE_HANDLE = "arapfields.remove_handle"
    DELETE_LEFT = "arapfields.delete_left"
    RESIZE_HANDLE = "arapfields.resize_handle"
    DEFORM = "arapfields.deform"
    SUBDIVIDE = "arapfields.subdivide"
    EXTRACT = "arapfields.extract"
    STYLIZE = "arapfields.stylize"
    SET_STYLE = "arapfields.set_style"
    WRAP = "arapfields.wrap"
    WRAP_SHEET = "arapfields.wrap_sheet"
    WRAP_SEQUENCE = "arapfields.wrap_sequence"
    SKIN = "arapfields.skin"
    TRANSFER = "arapfields.transfer"
    REFIT = "arapfields.refit"
    ADD_LANDMARK = "arapfields.add_landmark"
    CLICK_LANDMARKS = "arapfields.click_landmarks"
    SUGGEST_LANDMARKS = "arapfields.suggest_landmarks"
    RESET_BONES = "arapfields.reset_bones"
    MIRROR_LANDMARKS = "arapfields.mirror_landmarks"
    REMOVE_LANDMARK = "arapfields.remove_landmark"
    CARRY = "arapfields.carry"
    RELEASE = "arapfields.release"
    ADD_OBSTACLE = "arapfields.add_obstacle"
    REMOVE_OBSTACLE = "arapfields.remove_obstacle"
    STIFFNESS_PRESET = "arapfields.stiffness_preset"
    SAVE_POSE = "arapfields.save_pose"
    APPLY_POSE = "arapfields.apply_pose"
    REMOVE_POSE = "arapfields.remove_pose"
    EXPORT_POSE = "arapfields.export_pose"
    IMPORT_POSE = "arapfields.import_pose"
    LIVE = "arapfields.live"
    LIVE_KEEP = "arapfields.live_keep"
    APPLY_KEY = "arapfields.apply_as_shape_key"
    REMOVE_FIELD = "arapfields.remove_field"
    REMOVE_RESULT = "arapfields.remove_result"
    MIRROR_HANDLE = "arapfields.mirror_handle"
    BAKE = "arapfields.bake"
    FIELD_NODES = "arapfields.field_as_nodes"
    REMOVE_BAKE = "arapfields.remove_bake"
    EXPORT = "arapfields.export_animation"
    EXPORT_SPLATS = "arapfields.export_splats"
    PIN_TOOL = "arapfields.pin_tool"
    PIN_HOVER = "arapfields.pin_hover"
    PIN_DRAG = "arapfields.pin_drag"
    PIN_ANCHOR = "arapfields.pin_anchor"
    PIN_ADD = "arapfields.pin_add"
    PIN_DELETE = "arapfields.pin_delete"
    PIN_TURN = "arapfields.pin_turn"
    CANCEL = "arapfields.cancel"
    CLEAR_CACHE = "arapfields.clear_cache"
    COPY_REPORT = "arapfields.copy_report"
