# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel's settings are the native library's options: same names, same defaults."""

import pytest
from support.blender.inside import IN_BLENDER

import arapfields as af

if IN_BLENDER:
    import bpy
    from support.blender import scenes

    import addon.registration as registration
    from addon.blender.property_definitions import effective_values
    from addon.core.settings.parameters import DEFORM, FIT, TABLE
    from addon.core.settings.styles import STYLIZE

pytestmark = pytest.mark.in_blender


def test_names_and_defaults_are_the_librarys():
    addons_own = {option["name"] for block in TABLE.values() for option in block["further"]}
    tables = {"DeformOptions": DEFORM, "StylizeOptions": STYLIZE, "FitOptions": FIT}
    for name, table in tables.items():
        options = getattr(af, name)()
        for parameter in table:
            if parameter.name in addons_own:
                continue
            assert parameter.name in type(options).fields, (name, parameter.name)
            assert getattr(options, parameter.name) == parameter.default, (name, parameter.name)


def test_values_survive_single_precision():
    item = scenes.bar()

    class Operator:
        properties = type("P", (), {"is_property_set": staticmethod(lambda name: False)})

    values = effective_values(DEFORM, item.arapfields.deform, Operator)
    assert values == {p.name: p.default for p in DEFORM}
    assert bpy.context.object == item


def test_every_property_and_operator_is_described():
    bare = []
    for module in registration.MODULES:
        for cls in getattr(module, "CLASSES", []):
            if issubclass(cls, bpy.types.Operator):
                group, name = cls.bl_idname.split(".")
                if not getattr(getattr(bpy.ops, group), name).get_rna_type().description:
                    bare.append(cls.__name__)
            for prop in cls.bl_rna.properties:
                ours = prop.identifier in getattr(cls, "__annotations__", {})
                if ours and not prop.description:
                    bare.append(f"{cls.__name__}.{prop.identifier}")
    assert not bare, bare
