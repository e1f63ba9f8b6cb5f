# SPDX-License-Identifier: GPL-3.0-or-later
"""make demo: its picture is there, and its scene has what the captions say."""

import json
import os
import subprocess
import sys

import pages
import pytest

MOST = 360  # processor seconds of two cores in three minutes
SEEN = """
import json, os, sys
import bpy, numpy as np
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
graph, found = bpy.context.evaluated_depsgraph_get(), {}
for name in ("Mesh", "Posed", "Styled", "Wrapped"):
    item = bpy.data.objects[name]
    both = (item.data, item.evaluated_get(graph).data)
    rest, now = (np.array([vertex.co for vertex in mesh.vertices]) for mesh in both)
    found[name] = [float(np.linalg.norm(now - rest, axis=1).max()), len(item.modifiers)]
hats = [bpy.data.objects[name] for name in ("Hat", "Hat.001")]
found["hats"] = [list(hat.delta_location) for hat in hats]
print("FOUND" + json.dumps(found), flush=True)
os._exit(0)
"""


@pytest.mark.slow  # a deform, a style and a wrap by their defaults
def test_the_demo_shows_what_its_captions_say(tmp_path):
    from PIL import Image

    command = [sys.executable, str(pages.ROOT / "blender_scripts/demo.py"), "--output", str(tmp_path)]
    draft = {**os.environ, "STAGE_DRAFT": "1"}
    before = os.times()
    run = subprocess.run(command, env=draft, capture_output=True, text=True)
    spent = sum(os.times()[2:4]) - sum(before[2:4])
    assert run.returncode == 0, run.stdout[-2000:] + run.stderr[-3000:]
    assert spent < MOST
    picture = Image.open(tmp_path / "demo.png").convert("L")
    assert picture.width > 3 * picture.height and picture.getextrema()[1] - picture.getextrema()[0] > 150
    read = subprocess.run(
        [sys.executable, "-c", SEEN, str(tmp_path / "demo.blend")], capture_output=True, text=True
    )
    (line,) = [line for line in read.stdout.splitlines() if line.startswith("FOUND")]
    found = json.loads(line.removeprefix("FOUND"))
    assert found["Mesh"][0] == 0
    for name in ("Posed", "Styled", "Wrapped"):  # in place: a modifier each, the mesh as it was
        assert found[name][0] > 0.1 and found[name][1] == 1, name
    still, carried = found["hats"]
    assert still == [0, 0, 0] and max(map(abs, carried)) > 0.02
