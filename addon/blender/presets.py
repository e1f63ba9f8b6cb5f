# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings under a name of the user's own, by Blender's preset system."""

import bpy
from bl_operators.presets import AddPresetBase

from ..names import PROPERTY


def preset_classes(name, label, parameters, further=()):
    """The operator that stores presets of one section, and the menu that lists them.

    `further` names settings that are no parameter.
    """
    menu_name, folder = f"ARAPFIELDS_MT_{name}_presets", f"arapfields/{name}"
    operator = type(
        f"ARAPFIELDS_OT_{name}_preset",
        (AddPresetBase, bpy.types.Operator),
        {
            "__doc__": "Store these settings under a name, or remove the chosen ones",
            "bl_idname": f"arapfields.{name}_preset",
            "bl_label": f"Store {label} Preset",
            "preset_menu": menu_name,
            "preset_subdir": folder,
            "preset_defines": [f"settings = bpy.context.object.{PROPERTY}.owner.{name}"],
            "preset_values": [f"settings.{key}" for key in (*further, *(p.name for p in parameters))],
        },
    )
    menu = type(
        menu_name,
        (bpy.types.Menu,),
        {
            "bl_label": f"{label} Presets",
            "preset_subdir": folder,
            "preset_operator": "script.execute_preset",
            "draw": bpy.types.Menu.draw_preset,
        },
    )
    return operator, menu
