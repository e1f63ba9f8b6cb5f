# SPDX-License-Identifier: GPL-3.0-or-later
"""The steps of the workflow pages, by each page's own script on the scene that make examples writes."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pages
import pytest

WORKFLOWS = pages.ROOT / "docs" / "workflows"
HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with out/examples."""
    folder = tmp_path_factory.mktemp("workflows")
    command = [sys.executable, str(pages.ROOT / "blender_scripts/examples.py"), "--output", "out/examples"]
    made = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert made.returncode == 0, made.stderr[-3000:]
    return folder


def follow(page, place):
    """Runs the page's script, then the check of its name below."""
    command = [sys.executable, str(Path(__file__)), str(WORKFLOWS / f"{page}.md")]
    there = {**os.environ, "PWD": str(place)}  # what Blender takes for the folder it is in
    run = subprocess.run(command, cwd=place, env=there, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout[-2000:] + run.stderr[-4000:]


def seen(name):
    """(at rest, as shown) of an object's points."""
    import bpy

    item = bpy.data.objects[name]
    mesh = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    return [np.array([vertex.co for vertex in data.vertices]) for data in (item.data, mesh)]


def bones_are_in_reach():
    """Whether a click meets the bones, which lie within the mesh."""
    import bpy

    return all(item.show_in_front for item in bpy.data.objects if item.type == "ARMATURE")


def pins():
    rest, now = seen("Dinosaur")
    off, size = np.linalg.norm(now - rest, axis=1), np.ptp(rest[:, 2])
    feet = (rest[:, 2] < 0.08 * size) & (np.abs(rest[:, 1] - 0.02) < 0.1)
    head = (rest[:, 1] < -0.7) & (rest[:, 2] > 1.3)
    assert off[feet].max() < 0.02 * size and off[head].min() > 0.1 * size, (off[feet].max(), off[head].min())


def character():
    assert bones_are_in_reach()
    rest, now = seen("Body")
    hand = rest[:, 0] > 0.75
    assert (now - rest)[hand, 2].mean() > 0.2
    rest_shirt, shirt = (points[: len(seen("Shirt")[0])] for points in seen("Shirt"))
    assert np.linalg.norm(shirt - rest_shirt, axis=1).max() > 0.05
    assert len(__import__("bpy").data.objects["Body"].arapfields.carried) == 4


def skin():
    """Nobody's triangles part, and eyes stay as they are."""
    assert bones_are_in_reach()
    rest, now = seen("Body")
    _, first, same = np.unique(rest.round(5), axis=0, return_index=True, return_inverse=True)
    assert np.abs(now - now[first[same.ravel()]]).max() < 1e-3 and np.abs(now - rest).max() > 0.3
    eye_rest, eye = seen("Eye.L")
    assert np.allclose(np.ptp(eye_rest, axis=0).max(), np.linalg.norm(np.ptp(eye, axis=0)) / 3**0.5, rtol=0.1)


def animate():
    import bpy

    assert Path("out/examples/dinosaur.abc").stat().st_size > 100_000
    assert len(list(Path("out/examples/cache").glob("*.pc2"))) == 1
    bpy.context.scene.frame_set(25)
    rest, now = seen("Dinosaur")
    assert np.linalg.norm(now - rest, axis=1).max() > 0.2


def walk():
    """With the feet where they walk, the tail is elsewhere than its handles alone would have it."""
    import bpy

    scene, dinosaur = bpy.context.scene, bpy.data.objects["Dinosaur"]
    scene.frame_set(57)
    rest, swung = seen("Dinosaur")
    bpy.ops.arapfields.deform()
    _, stiff = seen("Dinosaur")
    size, off = np.ptp(rest[:, 2]), np.linalg.norm(swung - stiff, axis=1)
    tail, feet = rest[:, 1] > 1.2, rest[:, 2] < 0.08 * size
    assert dinosaur.arapfields.secondary.use
    assert off[tail].mean() > 0.05 * size and off[feet].mean() < 0.03 * size, (
        off[tail].mean(),
        off[feet].mean(),
    )


def wrap():
    """The dog, moved beside, lies on the scan."""
    import bpy
    from mathutils.bvhtree import BVHTree

    (_, dog), (_, scan) = seen("Dog"), seen("Scan")
    triangles = [tuple(face.vertices) for face in bpy.data.objects["Scan"].data.polygons]
    tree = BVHTree.FromPolygons(scan.tolist(), triangles)
    place = np.array(bpy.data.objects["Dog"].matrix_world)  # seen from the scan's own origin
    laid = dog @ place[:3, :3].T + place[:3, 3]
    off = np.array([tree.find_nearest(point)[3] for point in laid])
    size = np.linalg.norm(np.ptp(scan, axis=0))
    assert np.mean(off) < 0.01 * size, np.mean(off) / size


def transfer():
    """The grown-up has all of the child but its place, and raises its arm and its nose."""
    import bpy

    assert bones_are_in_reach()
    child, grown = bpy.data.objects["Child"], bpy.data.objects["Grown-up"]
    rest, now = seen("Grown-up")
    off, size = np.linalg.norm(now - rest, axis=1), np.ptp(rest[:, 2])
    hand, nose = rest[:, 0] > 0.75, (rest[:, 1] < -0.25) & (rest[:, 2] > 1.9)
    assert (now - rest)[hand, 2].min() > 0.2 * size and off[nose].max() > 0.05 * size
    assert grown.data.shape_keys.key_blocks.keys() == child.data.shape_keys.key_blocks.keys()
    assert {bone.name for bone in bpy.data.objects["Rig Grown-up"].data.bones} <= set(
        grown.vertex_groups.keys()
    )
    assert {"Shirt Grown-up", "Eye.L Grown-up", "Eye.R Grown-up"} <= {item.name for item in grown.children}
    assert np.abs(seen("Child")[0][:, 2]).max() < 1.9  # the child is back


def splats():
    """The head of the scan goes up, and its splats turn."""
    import bpy

    rest, now = seen("scan")
    assert np.linalg.norm(now - rest, axis=1).max() > 0.2
    scan = bpy.data.objects["scan"]
    evaluated = scan.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    turned = [np.array([v.value for v in mesh.attributes["rot_0"].data]) for mesh in (scan.data, evaluated)]
    assert np.allclose(turned[0], 1) and turned[1].min() < 0.99


def stylize():
    rest, now = seen("Dog")
    assert len(rest) == len(now) and np.linalg.norm(now - rest, axis=1).max() > 0.05


def contact():
    """The ends are down, and nothing of the bar lies in the ball."""
    import bpy

    bar, ball = bpy.data.objects["Bar"], bpy.data.objects["Ball"]
    rest, now = seen("Bar")
    ends, radius = np.abs(rest[:, 0]) > 0.75, ball.dimensions.z / 2
    away = np.linalg.norm(now + np.array(bar.location - ball.location), axis=1)
    assert (rest - now)[ends, 2].min() > 0.3
    assert away.min() > 0.99 * radius, away.min() / radius  # a ball of facets, .001 of the bar's length


def python():
    import trimesh

    raised = trimesh.load("raised.obj", process=False).vertices
    assert raised[:, 2].max() > 1.75


CHECKS = {
    check.__name__: check
    for check in (pins, character, skin, animate, walk, stylize, splats, wrap, transfer, contact, python)
}


@pytest.mark.slow  # the scenes and a bake take some ten seconds each
@pytest.mark.parametrize("page", CHECKS)
def test_the_steps_lead_where_the_page_says(page, place):
    follow(page, place)


@pytest.mark.slow
def test_the_batch_does_the_folder_and_goes_on(place):
    command = "blender_scripts/batch.py --style cube --input out/examples/meshes --output out/cubic"
    (word,) = [
        line
        for line in (WORKFLOWS / "batch.md").read_text().splitlines()
        if line.strip().startswith("python")
    ]
    assert command in word
    call = [sys.executable, str(pages.ROOT / "blender_scripts/batch.py"), *word.split()[2:]]
    for told in ("6 done", "6 skipped"):
        run = subprocess.run(call, cwd=place, capture_output=True, text=True)
        assert run.returncode == 0 and told in run.stdout, run.stdout[-2000:] + run.stderr[-2000:]
    assert len(list((place / "out/cubic").glob("*.ply"))) == 6


def test_each_workflow_has_a_picture_and_uses_make_examples():
    for page in WORKFLOWS.glob("*.md"):
        if page.stem not in ("index", "python", "cpp"):
            assert re.search(r"gallery/(loop|workflow)-", page.read_text().split("\n1. ")[0])
        assert "make examples" in page.read_text()


def main(page):
    sys.path[:0] = [str(HERE), str(pages.ROOT)]
    if "import bpy" in page.read_text():
        import bpy  # noqa: F401

        import addon

        addon.register()
    names = {}
    for line, code in pages.python_blocks(page):
        exec(compile("\n" * (line - 1) + code, pages.name(page), "exec"), names)
    CHECKS[page.stem]()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
    sys.stdout.flush()
    os._exit(0)  # bpy 4.5 may wait forever for a thread of its own while the process ends
