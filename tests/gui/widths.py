# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds labels of the panel that Blender would truncate: widths of texts in its font and of the sidebar."""

import blf
import bpy
import stage
from support.blender import panels

from addon.blender.section import Advanced
from addon.names import CONTEXT

MARGINS, LABELS = 47, 0.4  # pixels of tabs and edges; share of the rest for labels before values
ICON, PADDING = 20, 8  # pixels at a scale of 1


def checks(figures, folder):
    """At the default width all settings, in English and German; at a narrower one, set by mouse, those that
    are not advanced."""
    bar, interface = bpy.data.objects["Bar"].arapfields, bpy.context.preferences.view
    bar.surface = "FIT"
    bar.deform.field = bar.stylize.field = "neural"
    bar.deform.exact_handles = True
    languages = {"en_US", "de_DE"} & {"en_US", *bpy.app.translations.locales}
    for language in languages:
        interface.language = language
        yield 0.5
        figures[f"cut_{language}"] = cut()
    interface.language = "en_US"
    yield from narrower()
    for language in languages:
        interface.language = language
        yield 0.5
        stage.picture(folder, f"narrow-{language}")
        figures[f"cut_narrow_{language}"] = cut(everyday=True)
    interface.language = "en_US"
    yield from narrower(-8)


def narrower(step=8):
    """Drags the sidebar's edge."""
    window, area, _ = stage.view()
    region = next(one for one in area.regions if one.type == "UI")
    x, y = region.x, window.height - region.y - region.height // 2
    yield from stage.move(x, y, pause=0.5)
    stage.tool("mousedown", 1)
    for count in range(1, 9):
        yield 0.15
        stage.tool("mousemove", x + step * count, y)
    stage.tool("mouseup", 1)
    yield 1.0


class Measured(panels.Layout):
    """Replaces a layout: collects (text, pixels available for it)."""

    def __init__(self, found, width, row=None):
        super().__init__([])
        self.__dict__.update(found=found, width=width, buttons=row, is_split=True)

    def __setattr__(self, name, value):
        super().__setattr__(name, value)
        if name == "use_property_split":
            self.__dict__["is_split"] = value

    def note(self, text, room):
        self.found.append((bpy.app.translations.pgettext_iface(text, CONTEXT), room))

    def prop(self, data, name, **options):
        super().prop(data, name, **options)
        text, prop = self.texts.pop(), data.bl_rna.properties.get(name)
        if prop is None or options.get("icon_only"):
            return
        values = ((1 - LABELS) if self.is_split and text else 1) * self.width - PADDING
        is_switch = prop.type == "BOOLEAN" and not options.get("icon")
        if text.strip():
            self.note(text, values - ICON if is_switch else LABELS * self.width - PADDING)
        for item in prop.enum_items if prop.type == "ENUM" and not options.get("expand") else ():
            self.note(item.name, values - (PADDING if prop.is_enum_flag else ICON))

    def prop_enum(self, data, name, value):
        super().prop_enum(data, name, value)
        self.buttons.append((self.texts.pop(), 0))

    def operator(self, name, **options):
        given = super().operator(name, **options)
        button = (self.texts.pop(), ICON if options.get("icon", "NONE") != "NONE" else 0)
        if self.buttons is None:
            self.note(button[0], self.width - button[1] - PADDING)
        else:
            self.buttons.append(button)
        return given

    def label(self, text="", **options):
        if options.get("translate", True) and self.buttons is None:
            self.note(text, self.width - ICON)

    def template_list(self, *_, **__):
        """Rows contain names given by the user."""

    def row(self, heading="", **_):
        if heading:
            self.note(heading, LABELS * self.width - PADDING)
        return Measured(self.found, self.width, [])

    def column(self, **_):
        column = type(self)(self.found, self.width, self.buttons)
        column.use_property_split = self.is_split
        return column

    def menu(self, name, text=None, **options):
        super().menu(name)


def of_rows(found, row):
    """Buttons with a text share the width that buttons without one leave."""
    words = [(text, icon) for text, icon in row.buttons if text]
    left = row.width - ICON * (len(row.buttons) - len(words))
    for text, icon in words:
        row.note(text, left / len(words) - icon - PADDING)


def cut(everyday=False):
    """Texts of the shown sections that are wider than their place; `everyday`: without advanced ones."""
    window, area, _ = stage.view()
    region = next(one for one in area.regions if one.type == "UI")
    scale = bpy.context.preferences.system.ui_scale
    style = bpy.context.preferences.ui_styles[0].widget.points
    blf.size(0, style * scale)
    found, rows = [], []

    class Layout(Measured):
        def row(self, **options):
            row = super().row(**options)
            rows.append(row)
            return row

    with bpy.context.temp_override(window=window, area=area, region=region):
        for cls in panels.shown():
            if everyday and issubclass(cls, Advanced):
                continue
            section = type("Section", (), {"layout": Layout(found, region.width / scale - MARGINS)})()
            section.fill = cls.fill.__get__(section)
            cls.draw(section, bpy.context)
    for row in rows:
        of_rows(found, row)
    wide = {(text, blf.dimensions(0, text)[0] / scale - room) for text, room in found}
    return sorted((f"{text} by {excess:.0f}" for text, excess in wide if excess > 0), key=len)
