# SPDX-License-Identifier: GPL-3.0-or-later
"""object.arapfields: the settings, handles and results of one object."""

import bpy

from .animation.properties import ARAPFIELDS_PG_bake
from .blender.object_references import owner_of, settings_of
from .blender.selection import row_chosen
from .carried.properties import ARAPFIELDS_PG_carried
from .core.settings.choices import NORMALS
from .handles.properties import ARAPFIELDS_PG_handle
from .live.properties import ARAPFIELDS_PG_secondary
from .names import PROPERTY
from .pin_tool.properties import ARAPFIELDS_PG_scene
from .properties.choices import RESULT_ITEMS, extraction, output, result, surface
from .properties.solve_settings import ARAPFIELDS_PG_deform, ARAPFIELDS_PG_fit, ARAPFIELDS_PG_stylize
from .stiffness.properties import ARAPFIELDS_PG_stiffness
from .wrap.properties import ARAPFIELDS_PG_wrap


class ARAPFIELDS_PG_result(bpy.types.PropertyGroup):
    item: bpy.props.PointerProperty(type=bpy.types.Object, name="Object", description="The result object")
    kind: bpy.props.StringProperty(name="Kind", description="DEFORM, STYLIZE or EXTRACT")
    output: bpy.props.StringProperty(name="Output", description="WARP, SURFACE or REMESH")


def get_result(settings):
    return next(number for key, *_, number in RESULT_ITEMS if key == settings.target)


def set_result(settings, number):
    settings.target = next(key for key, *_, other in RESULT_ITEMS if other == number)


class ARAPFIELDS_PG_object(bpy.types.PropertyGroup):
    fit: bpy.props.PointerProperty(type=ARAPFIELDS_PG_fit, name="Fit", description="Settings of the fit")
    deform: bpy.props.PointerProperty(
        type=ARAPFIELDS_PG_deform, name="Deform", description="Settings of the deformation"
    )
    stylize: bpy.props.PointerProperty(
        type=ARAPFIELDS_PG_stylize, name="Stylize", description="Settings of the stylization"
    )
    wrap: bpy.props.PointerProperty(
        type=ARAPFIELDS_PG_wrap, name="Wrap", description="Settings of the wrap, its target and landmarks"
    )
    bake: bpy.props.PointerProperty(
        type=ARAPFIELDS_PG_bake, name="Bake", description="Settings of bakes, and what the last one is"
    )
    handles: bpy.props.CollectionProperty(
        type=ARAPFIELDS_PG_handle,
        name="Handles",
        description="Empties that hold and move parts of the object",
    )
    hold_far: bpy.props.BoolProperty(
        name="Hold What Is Far",
        description="While all handles are pins and none is an anchor, what is far from them holds its place "
        "by itself, weakly",
    )
    active_handle: bpy.props.IntProperty(
        name="Active Handle", description="Row chosen in the list of handles", update=row_chosen
    )
    stiffness: bpy.props.PointerProperty(
        type=ARAPFIELDS_PG_stiffness, name="Stiffness", description="Vertex groups that are stiffer or softer"
    )
    secondary: bpy.props.PointerProperty(
        type=ARAPFIELDS_PG_secondary, name="Secondary Motion", description="How the surface swings"
    )
    carried: bpy.props.CollectionProperty(
        type=ARAPFIELDS_PG_carried, name="Carried Objects", description="Objects that the field moves as well"
    )
    active_carried: bpy.props.IntProperty(
        name="Active Carried Object", description="Row chosen in the list of carried objects"
    )
    carried_by: bpy.props.PointerProperty(
        type=bpy.types.Object, name="Carried By", description="The object whose field moves this one"
    )
    silenced: bpy.props.StringProperty(
        name="Armatures Switched Off",
        description="Armature modifiers that the field replaces, and whether they were on, as JSON",
    )
    under_rig: bpy.props.BoolProperty(
        name="Before Armatures",
        description="Whether the field works on the shape at rest, which armatures pose afterwards",
    )
    rest_bones: bpy.props.StringProperty(
        name="Bones at Rest",
        description="Where an armature's bones were before they were fitted to a wrapped shape, as JSON",
    )
    handle_of: bpy.props.PointerProperty(
        type=bpy.types.Object, name="Handle Of", description="The object that this Empty is a handle of"
    )
    made_from: bpy.props.StringProperty(
        name="Made From", description="Name of the object that this result was made from when it was made"
    )
    results: bpy.props.CollectionProperty(
        type=ARAPFIELDS_PG_result, name="Results", description="Objects made from this one"
    )
    output: output()
    surface: surface()
    target: result()  # as files store it
    result: result(get=get_result, set=set_result)
    resolution: extraction().get("resolution")
    refine_thin: extraction().get("refine_thin")
    normals: bpy.props.EnumProperty(
        items=NORMALS, name="Normals", description="How meshes of the implicit surface are shaded"
    )
    live_kind: bpy.props.StringProperty(name="Live", description="DEFORM or STYLIZE while the object is live")
    live_hidden: bpy.props.StringProperty(
        name="Hidden before Live",
        description="Whether the object was hidden in viewport and renders, as JSON",
    )
    set_aside: bpy.props.BoolProperty(
        name="Set Aside", description="Hidden since what was made of it lies in its place"
    )
    fit_key: bpy.props.StringProperty(name="Fit", description="Name of the object's last fit in the cache")
    fit_options: bpy.props.StringProperty(
        name="Fit Settings", description="Settings of the object's last fit, as JSON"
    )
    fit_report: bpy.props.StringProperty(
        name="Fit Report", description="Figures of the object's last fit, as JSON"
    )

    @property
    def in_place(self):
        """Whether a result goes onto the source's own vertices, where they are at the modifier's place."""
        return self.output == "WARP" and self.result != "NEW"

    @property
    def owner(self):
        """The settings of the object that this one, a handle or a result, belongs to; its own for others."""
        source = owner_of(self.id_data)
        return settings_of(source) if source is not None else self


CLASSES = [ARAPFIELDS_PG_result, ARAPFIELDS_PG_object]


def attach():
    setattr(
        bpy.types.Object, PROPERTY, bpy.props.PointerProperty(type=ARAPFIELDS_PG_object, name="ARAP Fields")
    )
    setattr(
        bpy.types.Scene, PROPERTY, bpy.props.PointerProperty(type=ARAPFIELDS_PG_scene, name="ARAP Fields")
    )


def detach():
    for owner in (bpy.types.Object, bpy.types.Scene):
        if hasattr(owner, PROPERTY):
            delattr(owner, PROPERTY)
