# SPDX-License-Identifier: GPL-3.0-or-later
"""Script for Blender with a window: runs the named parts, or all that can share one. See docs/development.md.

blender --factory-startup --python tests/gui/window.py -- OUTPUT_FOLDER [PART ...]
blender --factory-startup --python tests/gui/window.py -- OUTPUT_FOLDER film=PINS.blend
Writes checks.json, judged.json and pictures, prints failures, and quits Blender; exit code 1 on failure.
tests/gui/verdicts.py contains the expected results. ImageMagick's `import` takes pictures; xdotool moves the
mouse.
"""

import functools
import importlib
import sys
from pathlib import Path

import bpy

ROOT = Path(__file__).resolve().parents[2]
OUTPUT, *GIVEN = sys.argv[sys.argv.index("--") + 1 :]
sys.path[:0] = [str(ROOT), str(ROOT / "tests"), str(ROOT / "tests/gui")]
sys.path.append(str(ROOT / "blender_scripts"))  # film.py

import stage  # noqa: E402
from support.blender import scenes  # noqa: E402

import addon  # noqa: E402

TOGETHER = {name: (name, "checks") for name in ("panel", "use", "jobs", "pins")}
TOGETHER |= {"live": ("use", "live_checks"), "undo": ("pins", "undo_checks"), "wrap": ("wrapping", "checks")}
TOGETHER |= {"labels": ("widths", "checks"), "endings": ("jobs", "endings")}
ALONE = ("film", "tutorial")  # each in a separate Blender


def checks(module, name="checks"):
    return getattr(importlib.import_module(module), name)


def together(figures, folder, names):
    """Yields seconds to wait, in which Blender's event loop runs. The last job must not delay the exit."""
    first = stage.look()
    for name in sorted(names, key="endings".__eq__):  # last: the code below continues it
        stage.record(name, stage.BEGUN, folder)
        yield from stage.as_at_first(first)
        yield from checks(*TOGETHER[name])(figures, folder)
        if name != "endings":
            stage.judge(figures, name, folder)
    addon.unregister()
    figures["switched_off"] = not hasattr(bpy.types.Object, "arapfields")
    addon.register()
    stage.empty_file()
    with stage.override():
        scenes.bar_with_handles()
        bpy.ops.arapfields.live("INVOKE_DEFAULT")
        bpy.data.objects["Bar"].arapfields.result = "NEW"  # refused for the live object itself
        bpy.ops.arapfields.deform("INVOKE_DEFAULT", **scenes.NEW | {"iterations": 200000})
    yield 0.5


def main():
    names = [given.split("=")[0] for given in GIVEN] or list(TOGETHER)
    if names[0] in ALONE:
        steps = functools.partial(
            checks(names[0]), *(Path(given.split("=")[1]) for given in GIVEN if "=" in given)
        )
    else:
        steps = functools.partial(together, names=names)
    stage.start(steps, names, Path(OUTPUT))


main()
