# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's preferences, with defaults if there are none, and the user's presets."""

import os
import tempfile
from pathlib import Path

import bpy
from bl_operators.presets import AddPresetBase

from ..core.files import FitCache
from ..core.settings.parameters import presets
from ..names import PACKAGE, PROPERTY
from .object_references import settings_of, source_of
from .source_operator import SETTINGS, SourceOperator

# The add-on's preferences, with defaults if there are none.


def preferences():
    """The add-on's preferences; None if it runs from its source folder."""
    entry = bpy.context.preferences.addons.get(PACKAGE)
    return entry.preferences if entry else None


def machine_options():
    """Options that depend on the machine alone."""
    stored = preferences()
    return {"threads": stored.threads, "device": stored.device} if stored else {}


def shows(name):
    """Whether the preference of that name, show_boxes or show_previews, is on, which is the default."""
    stored = preferences()
    return stored is None or getattr(stored, name)


def cache_folder():
    """Folder of stored fits: the user's choice, the extension's user folder, or a temporary one."""
    stored = preferences()
    if stored and stored.cache_folder:
        return Path(bpy.path.abspath(stored.cache_folder))
    try:
        return Path(bpy.utils.extension_path_user(PACKAGE, path="fits", create=False))
    except ValueError:  # not run as an extension
        return (
            Path(tempfile.gettempdir())
            / f"arapfields-fits-{os.getuid() if hasattr(os, 'getuid') else 'user'}"
        )


def fit_cache():
    return FitCache(cache_folder())


# Presets of settings: the user's own, by Blender's preset system, and those of the native library.

DEFAULT = ("DEFAULT", "Default", "Every setting of this section as it is at first")


def preset_classes(name, label, parameters, further=(), given=True):
    """The classes of a section's presets: operator that stores them, menu, operator that applies native ones.

    `further` names settings that are no parameter. `given`: whether the menu starts with the library's.
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
    setters = [given_presets(name, label, parameters)] if given else []

    def draw(self, context):
        for setter in setters:
            self.layout.operator_enum(setter.bl_idname, "preset")
            self.layout.separator()
        bpy.types.Menu.draw_preset(self, context)

    menu = type(
        menu_name,
        (bpy.types.Menu,),
        {
            "bl_label": f"{label} Presets",
            "preset_subdir": folder,
            "preset_operator": "script.execute_preset",
            "draw": draw,
        },
    )
    return operator, menu, *setters


def given_presets(name, label, parameters):
    """The operator that sets a section to a preset from the library's table of options."""
    table = presets(name)

    def execute(self, context):
        group = getattr(settings_of(source_of(context)), name)
        for parameter in parameters:
            group.property_unset(parameter.name)
        if self.preset in table:
            for option, value in table[self.preset][2].items():
                setattr(group, option, value)
        return {"FINISHED"}

    items = (DEFAULT, *((key, text, tip) for key, (text, tip, _) in table.items()))
    annotated = {"preset": bpy.props.EnumProperty(items=items, name="Preset")}
    return type(
        f"ARAPFIELDS_OT_{name}_given_preset",
        (SourceOperator, bpy.types.Operator),
        {
            "__doc__": "Set this section to a preset",
            "__annotations__": annotated,
            "bl_idname": f"arapfields.{name}_given_preset",
            "bl_label": f"Set {label} Preset",
            "bl_options": {"REGISTER", "UNDO"},
            "guide": SETTINGS[f"ARAPFIELDS_PG_{name}"],
            "execute": execute,
        },
    )
