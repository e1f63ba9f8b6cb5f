# SPDX-License-Identifier: GPL-3.0-or-later
"""object.arapfields: the settings, handles and results of one object."""

import bpy

from .animation.properties import ARAPFIELDS_PG_bake
from .blender.object_references import owner_of, row_chosen, settings_of
from .blender.property_definitions import choice, collection, flag, integer, number, pointer, tells, text
from .contact.properties import ARAPFIELDS_PG_contact
from .core.settings.choices import CARRYING, NORMALS
from .handles.properties import ARAPFIELDS_PG_handle
from .live.properties import ARAPFIELDS_PG_secondary
from .names import BONE_NUMBER, PROPERTY
from .pin_tool.properties import ARAPFIELDS_PG_scene
from .properties.choices import RESULT_ITEMS, extraction, output, result, surface
from .properties.solve_settings import ARAPFIELDS_PG_deform, ARAPFIELDS_PG_fit, ARAPFIELDS_PG_stylize
from .skin.properties import ARAPFIELDS_PG_skin
from .stiffness.properties import ARAPFIELDS_PG_stiffness
from .wrap.properties import ARAPFIELDS_PG_wrap

OVERRIDABLE = {"LIBRARY_OVERRIDABLE"}  # library overrides keep it, so that they can be carried


BASE_KINDS = (
    ("NONE", "None", "The field moves the object's points, or nothing yet"),
    ("TRANSFORM", "Delta Transforms", "The field moves the object as a whole"),
    ("BONES", "Bones", "The field poses the armature's bones"),
)


class ARAPFIELDS_PG_carried(bpy.types.PropertyGroup):
    # `name`, which every PropertyGroup has, keeps the object's name for messages after its deletion
    item: pointer(bpy.types.Object, "Object", "Moved by the field of the object that carries it")
    way: choice(CARRYING, "Way", "How the object is carried")
    base: text("Own Pose", "The object's own delta transforms or pose while the field moves it, as JSON")
    base_kind: choice(BASE_KINDS, "Kind of Own Pose", "What the object's own pose consists of")


class ARAPFIELDS_PG_result(bpy.types.PropertyGroup):
    item: pointer(bpy.types.Object, "Object", "The result object", override=OVERRIDABLE)
    kind: text("Kind", "DEFORM, STYLIZE or EXTRACT", override=OVERRIDABLE)
    output: text("Geometry", "WARP, SURFACE or REMESH", override=OVERRIDABLE)


def get_result(settings):
    return next(number for key, *_, number in RESULT_ITEMS if key == settings.target)


def set_result(settings, number):
    settings.target = next(key for key, *_, other in RESULT_ITEMS if other == number)


class ARAPFIELDS_PG_object(bpy.types.PropertyGroup):
    fit: pointer(ARAPFIELDS_PG_fit, "Fit", "Settings of the fit")
    deform: pointer(ARAPFIELDS_PG_deform, "Deform", "Settings of the deformation")
    stylize: pointer(ARAPFIELDS_PG_stylize, "Stylize", "Settings of the stylization")
    wrap: pointer(ARAPFIELDS_PG_wrap, "Wrap", "Settings of the wrap, its target and landmarks")
    skin: pointer(ARAPFIELDS_PG_skin, "Skin", "How meshes are skinned to this armature")
    bake: pointer(ARAPFIELDS_PG_bake, "Bake", "Settings of bakes, and what the last one is")
    handles: collection(ARAPFIELDS_PG_handle, "Handles", "Empties that hold and move parts of the object")
    defaults: integer("Version of Defaults", "Which defaults the settings that were never set have")
    hold_far: flag(
        "Hold What Is Far",
        "While all handles are pins and none is an anchor, what is far from them holds its place "
        "by itself, weakly",
    )
    keep_rest: flag(
        "Keep the Rest",
        "As in files made before Locality: while all handles are pins, what is far from all but the "
        "anchors holds its place",
    )
    keep_beyond: number(
        "Keep Beyond",
        "Distance from the pins, at rest, from which the rest is kept; the pin tool shows it by circles",
        subtype="DISTANCE",
        min=0.0,
    )
    active_handle: integer("Active Handle", "Row chosen in the list of handles", update=row_chosen)
    stiffness: pointer(ARAPFIELDS_PG_stiffness, "Stiffness", "Vertex groups that are stiffer or softer")
    secondary: pointer(ARAPFIELDS_PG_secondary, "Secondary Motion", "How the surface swings")
    contact: pointer(ARAPFIELDS_PG_contact, "Contact", "What the surface does not pass")
    carried: collection(ARAPFIELDS_PG_carried, "Carried Objects", "Objects that the field moves as well")
    active_carried: integer("Active Carried Object", "Row chosen in the list of carried objects")
    carried_by: pointer(
        bpy.types.Object, "Carried By", "The object whose field moves this one", override=OVERRIDABLE
    )
    field_helper: pointer(
        bpy.types.Object, "Field as Nodes", "What has the field's numbers, where nodes evaluate it"
    )
    silenced: text(
        "Armatures Switched Off",
        "Armature modifiers that the field replaces, and whether they were on, as JSON",
    )
    long_triangles: integer(
        "Long Triangles", "Triangles that are too long for the last deformation, and turn over"
    )
    moved_by: text("Moved By", "DEFORM, STYLIZE, POSED or WRAP: what the field's motion comes from")
    under_rig: flag(
        "Before Armatures", "Whether the field works on the shape at rest, which armatures pose afterwards"
    )
    rest_bones: text(
        "Bones at Rest", "Where an armature's bones were before they were fitted to a wrapped shape, as JSON"
    )
    handle_of: pointer(bpy.types.Object, "Handle Of", "The object that this Empty is a handle of")
    made_from: text("Made From", "Name of the object that this result was made from when it was made")
    results: collection(
        ARAPFIELDS_PG_result,
        "Results",
        "Objects made from this one",
        override={*OVERRIDABLE, "USE_INSERTION"},
    )
    output: output(update=tells("place"))
    surface: surface()
    target: result()  # the name in files
    result: result(get=get_result, set=set_result, update=tells("place"))
    resolution: extraction().get("resolution")
    refine_thin: extraction().get("refine_thin")
    normals: choice(NORMALS, "Normals", "How meshes of the implicit surface are shaded")
    live_kind: text("Live", "DEFORM or STYLIZE while the object is live")
    live_number: integer("Live Session", "Number of the session that the object is live by")
    held: text("Held", "Digests of a pose and of the shape that a press without a move holds for it")
    live_hidden: text("Hidden before Live", "Whether the object was hidden in viewport and renders, as JSON")
    set_aside: flag("Set Aside", "Hidden since what was made of it lies in its place", override=OVERRIDABLE)
    fit_key: text("Fit", "Name of the object's last fit in the cache")
    fit_options: text("Fit Settings", "Settings of the object's last fit, as JSON")
    fit_report: text("Fit Report", "Figures of the object's last fit, as JSON")

    @property
    def in_place(self):
        """Whether the result moves the source's own vertices, at the field modifier's place in the stack."""
        return self.output == "WARP" and self.result != "NEW"

    @property
    def owner(self):
        """The settings of the source of this handle or result; for other objects these settings."""
        source = owner_of(self.id_data)
        return settings_of(source) if source is not None else self


def attach():
    setattr(bpy.types.Bone, BONE_NUMBER, bpy.props.IntProperty(name="ARAP Fields", options={"HIDDEN"}))
    ours = bpy.props.PointerProperty(type=ARAPFIELDS_PG_object, name="ARAP Fields", override=OVERRIDABLE)
    setattr(bpy.types.Object, PROPERTY, ours)
    setattr(
        bpy.types.Scene, PROPERTY, bpy.props.PointerProperty(type=ARAPFIELDS_PG_scene, name="ARAP Fields")
    )


def detach():
    for owner in (bpy.types.Object, bpy.types.Scene):
        if hasattr(owner, PROPERTY):
            delattr(owner, PROPERTY)
    if hasattr(bpy.types.Bone, BONE_NUMBER):
        delattr(bpy.types.Bone, BONE_NUMBER)


CLASSES = [ARAPFIELDS_PG_carried, ARAPFIELDS_PG_result, ARAPFIELDS_PG_object]
