# SPDX-License-Identifier: GPL-3.0-or-later
"""Run by a real Blender with a window: jobs, live mode, the panel. docs/development.md says how.

blender --factory-startup --python tests/gui/window.py -- OUTPUT_FOLDER [PART ...]
Parts are panel, use, picks, jobs, stalls, live, press, pins, undo, render, table, wrap and endings; all where
none is named. Of some there are shorter ones: picks-in-place, pins-rate, undo-within and undo-escaped. Writes
checks.json, and pictures where ImageMagick's `import` is at hand; xdotool moves the mouse.
Ends with a job running, which must not hold it.
"""

import json
import sys
from pathlib import Path

import bpy

ROOT = Path(__file__).resolve().parents[2]
OUTPUT, *PARTS = sys.argv[sys.argv.index("--") + 1 :]
OUTPUT = Path(OUTPUT)
sys.path[:0] = [str(ROOT), str(ROOT / "tests"), str(ROOT / "tests/gui")]

import jobs  # noqa: E402
import live  # noqa: E402
import panel  # noqa: E402
import picks  # noqa: E402
import pins  # noqa: E402
import press  # noqa: E402
import render  # noqa: E402
import stage  # noqa: E402
import stalls  # noqa: E402
import table  # noqa: E402
import undo  # noqa: E402
import use  # noqa: E402
import wrapping  # noqa: E402
from support.blender import scenes  # noqa: E402

import addon  # noqa: E402

FOUND = {}
WITHIN_OTHERS = ("picks-in-place", "pins-rate", "undo-within", "undo-escaped")


def steps():
    """Yields seconds to wait; between them Blender's event loop runs."""
    parts = {
        "panel": lambda: panel.checks(FOUND, OUTPUT),
        "use": lambda: use.checks(FOUND, OUTPUT),
        "picks": lambda: picks.checks(FOUND, OUTPUT),
        "picks-in-place": lambda: picks.checks(FOUND, OUTPUT, picks.IN_PLACE),
        "jobs": lambda: jobs.checks(FOUND, OUTPUT),
        "stalls": lambda: stalls.checks(FOUND, OUTPUT),
        "live": lambda: live.checks(FOUND, OUTPUT),
        "press": lambda: press.checks(FOUND, OUTPUT),
        "pins": lambda: pins.checks(FOUND, OUTPUT),
        "pins-rate": lambda: pins.first_and_rate(FOUND, OUTPUT),
        "undo": lambda: undo.checks(FOUND, OUTPUT),
        "undo-within": lambda: undo.checks(FOUND, OUTPUT, ("within",)),
        "undo-escaped": lambda: undo.checks(FOUND, OUTPUT, ("escaped",)),
        "render": lambda: render.checks(FOUND, OUTPUT),
        "table": lambda: table.checks(FOUND, OUTPUT),
        "wrap": lambda: wrapping.checks(FOUND, OUTPUT),
        "endings": lambda: jobs.endings(FOUND),
    }
    stage.empty_file()
    with stage.override():
        scenes.bar_with_handles()
        bpy.ops.view3d.view_all()
    yield from stage.open_sidebar()
    for name in PARTS or [name for name in parts if name not in WITHIN_OTHERS]:
        yield from parts[name]()
    addon.unregister()
    FOUND["switched_off"] = not hasattr(bpy.types.Object, "arapfields")
    addon.register()
    stage.empty_file()
    with stage.override():
        scenes.bar_with_handles()
        bpy.ops.arapfields.live("INVOKE_DEFAULT")
        bpy.data.objects["Bar"].arapfields.target = "NEW"  # the live one itself would refuse
    jobs.invoke(jobs.LONG)
    yield 0.5


def ended(error):
    FOUND.update({"error": error} if error else {"finished": True})
    (OUTPUT / "checks.json").write_text(json.dumps(FOUND, indent=1))


stage.start(steps, ended, OUTPUT)
