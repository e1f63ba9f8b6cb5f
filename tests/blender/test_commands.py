# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's command line without a window: real files in, real files out."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER, require_bpy
from support.geometry import meshes

from arapfields.cli.files import read_mesh
from arapfields.cli.meshes import formats

if IN_BLENDER:
    import bpy
    from support.blender import baking, scenes

    from addon.commands import files

# deform, stylize and batch as scripts of Python's bpy: real files in, real files out.

ROOT = Path(__file__).resolve().parents[2]
QUICK = ["--iterations", "20", "--samples", "1000", "--batch", "100", "--width", "16", "--layers", "1"]
# A network without a finish: with one, the field takes few steps and the mesh ends the solve.
ENDLESS = [*QUICK, "--field", "neural", "--no-finish", "--iterations", "1000000"]
HOLD_AND_LIFT = {
    "handles": [
        {"type": "cuboid", "corners": [[None, None, None], [-0.5, None, None]]},
        {
            "type": "cuboid",
            "corners": [[0.5, None, None], [None, None, None]],
            "move": {"translate": [0, 0, 0.4]},
        },
    ]
}


@pytest.fixture(autouse=True)
def needs_bpy():
    require_bpy()


@pytest.fixture
def script(user_folder):
    """The same as `command`, by a script in a process of its own."""

    def run(verb, *arguments, check=True):
        call = [sys.executable, str(ROOT / f"blender_scripts/{verb}.py"), *map(str, arguments)]
        done = subprocess.run(call, env=user_folder, capture_output=True, text=True)
        assert not check or done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
        return done

    return run


def write_ball(path, level=3):
    """An icosphere in the format of the path's suffix; returns its (n, 3) vertices."""
    vertices, triangles = meshes.sphere(subdivisions=level)
    if path.suffix == ".obj":
        lines = ["mtllib none.mtl", "o Ball", *(f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in vertices)]
        lines += [f"vt {x:.6f} {y:.6f}" for x, y, _ in vertices]
        lines += ["f " + " ".join(f"{i + 1}/{i + 1}" for i in row) for row in triangles]
        path.write_text("\n".join(lines) + "\n")
    else:
        import trimesh

        trimesh.Trimesh(vertices, triangles, process=False).export(path)
    return vertices


def read(path):
    from arapfields.cli.files import read_mesh

    return read_mesh(path)


def flatness(vertices, triangles):
    """Mean of the largest component of the face normals: 1 for a cube along the axes."""
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    return float((np.abs(normals).max(axis=1)).sum() / areas.sum())


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl"])
def test_stylize_a_file(command, tmp_path, suffix):
    source, target = tmp_path / f"ball{suffix}", tmp_path / f"results/cubic{suffix}"
    write_ball(source)
    further = ["--report", tmp_path / "report.json", "--iterations", "60"]
    command("stylize", "--style", "cube", "-i", source, "-o", target, *QUICK, *further)
    before, after = read(source), read(target)
    assert before[1].shape == after[1].shape
    assert flatness(*after) > flatness(*before) + 0.03
    (report,) = json.loads((tmp_path / "report.json").read_text())["objects"]
    assert report["status"] == "done" and report["figures"]["iterations"] == 60
    assert [path.name for path in target.parent.iterdir()] == [target.name]  # nothing partial
    if suffix == ".obj":
        assert target.read_text().count("\nvt ") and "o Ball\n" in target.read_text()


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl", ".blend"])
def test_a_full_disk_is_named_and_changes_nothing(command, tmp_path, suffix):
    source, target = tmp_path / "ball.ply", tmp_path / f"results/cubic{suffix}"
    write_ball(source)
    target.parent.mkdir()
    target.write_text("before")
    call = ["stylize", "--style", "cube", "-i", source, "-o", target, *QUICK]
    done = command(*call, check=False, largest=6000)
    assert done.returncode != 0 and str(target) in done.stderr, done
    assert [path.name for path in target.parent.iterdir()] == [target.name]
    assert target.read_text() == "before"


def blenders_at_work(process):
    """Its children's folders in /proc, as soon as one of them has loaded the library."""
    while True:
        tasks = Path(f"/proc/{process.pid}/task").glob("*/children")
        children = [Path(f"/proc/{pid}") for path in tasks for pid in path.read_text().split()]
        if any("_native" in (child / "maps").read_text() for child in children):
            return children
        assert process.poll() is None
        time.sleep(0.05)


def test_a_script_ends_whatever_python_waits_for_as_it_ends(user_folder, tmp_path):
    """As its module of Blender does for ever, once in some hundred interruptions."""
    (tmp_path / "sitecustomize.py").write_text("import atexit, time\natexit.register(time.sleep, 600)\n")
    paths = os.pathsep.join([str(tmp_path), user_folder["PYTHONPATH"]])
    call = [sys.executable, str(ROOT / "blender_scripts/stylize.py"), "-i", "absent.ply", "-o", "out.ply"]
    environment = user_folder | {"PYTHONPATH": paths, "TMPDIR": str(tmp_path)}
    done = subprocess.run(call, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2 and "absent.ply" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["sitecustomize.py"]


def test_a_batch_that_is_killed_takes_its_blenders_along(user_folder, tmp_path):
    (tmp_path / "in").mkdir()
    write_ball(tmp_path / "in/ball.ply")
    call = [sys.executable, str(ROOT / "blender_scripts/batch.py"), "--style", "cube", "--input"]
    call += [str(tmp_path / "in"), "--output", str(tmp_path / "out"), *ENDLESS]
    process = subprocess.Popen(call, env=user_folder, stdout=subprocess.PIPE, text=True)
    while "files to do" not in process.stdout.readline():
        assert process.poll() is None
    children = blenders_at_work(process)
    process.kill()
    process.wait()
    begin = time.monotonic()
    while any(path.exists() for path in children):
        assert time.monotonic() - begin < 60.0
        time.sleep(0.2)


def test_deform_a_file_under_handles(script, tmp_path):
    source, target = tmp_path / "ball.ply", tmp_path / "lifted.ply"
    before = write_ball(source)
    (tmp_path / "pose.json").write_text(json.dumps(HOLD_AND_LIFT))
    script(
        "deform", "-i", source, "-o", target, "--handles", tmp_path / "pose.json", *QUICK, "--iterations", 150
    )
    moved = read(target)[0] - before
    assert abs(moved[before[:, 0] > 0.7, 2].mean() - 0.4) < 0.1
    assert abs(moved[before[:, 0] < -0.7]).max() < 0.1


def save_bars(path):
    """In the worker: a bar with a handle that is moved, and another bar."""
    _, _, moving = scenes.bar_with_handles()
    moving.location.z += 0.3
    scenes.bar("Other").location.y = 5
    bpy.ops.wm.save_as_mainfile(filepath=path)


def check_bars(path):
    bpy.ops.wm.open_mainfile(filepath=path)
    assert sorted(bpy.data.objects.keys()) == ["Bar", "Bar_deformed", "Fixed", "Moving", "Other"]


def test_a_blend_keeps_its_handles_and_gets_the_results(blender, command, tmp_path):
    source, target = tmp_path / "bar.blend", tmp_path / "out.blend"
    blender.call(__file__, "save_bars", {"path": source})
    command("deform", "-i", source, "-o", target, *QUICK)
    blender.call(__file__, "check_bars", {"path": target})
    command("deform", "-i", source, "-o", tmp_path / "bar.ply", *QUICK)
    assert read(tmp_path / "bar.ply")[0][:, 2].max() > 0.3
    failed = command("stylize", "-i", source, "-o", tmp_path / "x.ply", "--objects", "Bax", check=False)
    assert failed.returncode == 2 and "no mesh object named Bax; there are: Bar, Other" in failed.stderr


def test_a_batch_does_what_it_can_and_resumes(script, tmp_path):
    (tmp_path / "in").mkdir()
    for name in ("a.ply", "b.obj"):
        write_ball(tmp_path / "in" / name, level=2)
    (tmp_path / "in/broken.ply").write_text("ply\nnonsense")
    call = ["batch", "--style", "cube", "--input", tmp_path / "in", "--output", tmp_path / "out", "--jobs", 2]
    first = script(*call, *QUICK, check=False)
    assert first.returncode == 1 and "2 done, 0 skipped, 1 failed" in first.stdout, first
    assert "broken.ply: FAILED" in first.stdout and "cannot read it" in first.stdout
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["a.ply", "arapfields-batch", "b.obj"]
    write_ball(tmp_path / "in/broken.ply", level=2)
    second = script(*call, *QUICK)
    assert "1 done, 2 skipped, 0 failed" in second.stdout


def test_ctrl_c_leaves_no_partial_file(user_folder, tmp_path):
    (tmp_path / "in").mkdir()
    write_ball(tmp_path / "in/ball.ply")
    call = [sys.executable, str(ROOT / "blender_scripts/batch.py"), "--style", "cube", "--input"]
    call += [str(tmp_path / "in"), "--output", str(tmp_path / "out"), *ENDLESS]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(call, env=user_folder, **pipes)
    while "files to do" not in process.stdout.readline():
        assert process.poll() is None
    blenders_at_work(process)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 130 and "arapfields: interrupted" in said
    left = [path.name for path in (tmp_path / "out").rglob("*")]
    assert set(left) <= {"arapfields-batch", "batch.json", "lock"}  # no result, whole or in part


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [("none.ply", None, "no such file"), ("a.gltf", "", "unknown extension"), ("empty.obj", "", "no mesh")],
)
def test_what_cannot_be_read_is_one_line(command, tmp_path, name, content, text):
    if content is not None:
        (tmp_path / name).write_text(content)
    done = command("stylize", "-i", tmp_path / name, "-o", tmp_path / "x.ply", check=False)
    said = [line for line in done.stderr.splitlines() if line.startswith("arapfields")]
    assert done.returncode == 2 and len(said) == 1 and text in said[0] and name in said[0]


def test_an_obj_keeps_the_colours_of_its_vertices(script, tmp_path):
    vertices, triangles = meshes.sphere(subdivisions=2)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f} 0.8 0.4 {(z + 1) / 2:.4f}" for x, y, z in vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles]
    (tmp_path / "scan.obj").write_text("\n".join(lines) + "\n")
    for end in ("obj", "ply"):
        script(
            "stylize", "--style", "cube", "-i", tmp_path / "scan.obj", "-o", tmp_path / f"out.{end}", *QUICK
        )
        found = formats.read(tmp_path / f"out.{end}").colours
        wanted = np.stack(
            [np.full(len(vertices), 0.8), np.full(len(vertices), 0.4), (vertices[:, 2] + 1) / 2], 1
        )
        assert np.abs(found[:, :3] - wanted).max() < 0.005  # a byte, and its way through linear colours


def test_what_single_precision_costs_far_coordinates_is_said(script, tmp_path):
    vertices, triangles = meshes.sphere(subdivisions=2)
    for name, place in (("near", [1.0, 2.0, 3.0]), ("far", [432150.25, 5210437.75, 310.5])):
        lines = ["v " + " ".join(map(repr, row)) for row in (vertices + place).tolist()]
        lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles]
        (tmp_path / f"{name}.obj").write_text("\n".join(lines) + "\n")
        done = script(
            "stylize", "--style", "cube", "-i", tmp_path / f"{name}.obj", "-o", tmp_path / "a.obj", *QUICK
        )
        said = [line for line in done.stderr.splitlines() if "single precision" in line]
        assert [("off by up to 0.25 of a size of 3.46" in line) for line in said] == [True] * (name == "far")


@pytest.mark.skipif(os.name == "nt", reason="a shell of other systems")
def test_a_script_works_without_standard_error(user_folder, tmp_path):
    write_ball(tmp_path / "ball.ply", level=2)
    call = [sys.executable, str(ROOT / "blender_scripts/stylize.py"), "--style", "cube"]
    call += ["-i", str(tmp_path / "ball.ply"), "-o", str(tmp_path / "out.ply"), *QUICK]
    quoted = " ".join(f"'{word}'" for word in call)
    done = subprocess.run(["sh", "-c", f"{quoted} 2>&-"], env=user_folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:]
    assert formats.read(tmp_path / "out.ply").vertices.shape == read(tmp_path / "ball.ply")[0].shape


def test_an_obj_keeps_its_polygons_materials_and_textures(script, tmp_path):
    (tmp_path / "in/maps").mkdir(parents=True)
    (tmp_path / "in/box.mtl").write_text("newmtl skin\nKd 0.5 0.4 0.3\nmap_Kd maps/skin.ppm\n")
    (tmp_path / "in/maps/skin.ppm").write_bytes(b"P6 1 1 255 abc")
    corners = [f"v {x} {y} {z}" for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = ["f 1 2 4 3", "f 5 7 8 6", "f 1 5 6 2", "f 3 4 8 7", "f 1 3 7 5", "f 2 6 8 4"]
    lines = ["mtllib box.mtl", "o Box", *corners, "usemtl skin", *faces]
    (tmp_path / "in/box.obj").write_text("\n".join(lines) + "\n")
    target = tmp_path / "out/deep/box.obj"
    script("stylize", "--style", "octahedron", "-i", tmp_path / "in/box.obj", "-o", target, *QUICK)
    text = target.read_text()
    assert [len(line.split()) for line in text.splitlines() if line.startswith("f ")] == [5] * 6
    assert "mtllib box.mtl" in text and "usemtl skin" in text
    materials = target.with_suffix(".mtl").read_text()
    (texture,) = [line.split()[1] for line in materials.splitlines() if line.startswith("map_Kd")]
    assert (target.parent / texture).resolve() == tmp_path / "in/maps/skin.ppm"


# Relative paths on the command line, of a process that another started in a folder of its choice.


@pytest.mark.in_blender
@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl", ".blend"])
def test_relative_paths_are_those_of_the_working_folder(suffix, tmp_path):
    """As subprocess.run(cwd=…) starts it: PWD is the other process's, and both folders have such a file."""
    folders, before = [Path(tmp_path) / name for name in ("here", "there")], os.getcwd()
    for length, folder in enumerate(folders, 1):
        folder.mkdir()
        bpy.ops.wm.read_homefile(use_empty=True)
        files.write(folder / f"bar{suffix}", [scenes.bar(length=length)])
    os.chdir(folders[0])
    try:
        with mock.patch.dict(os.environ, PWD=str(folders[1])):
            files.read(Path(f"bar{suffix}"))
            (bar,) = bpy.data.objects
            assert max(bar.dimensions) == pytest.approx(2.0)
            files.write(Path(f"out{suffix}"), [bar])
    finally:
        os.chdir(before)
    names = [sorted(path.name for path in folder.iterdir()) for folder in folders]
    assert names == [[f"bar{suffix}", f"out{suffix}"], [f"bar{suffix}"]]


# A .blend as a job: baked by one process, or by several that share its frames, with kills in between.


def save_scene(folder):
    """In the worker: scene.blend with a bar that bends from frame 1 to 5."""
    baking.saved_animation("Bar", Path(folder))
    bpy.context.scene.frame_end = 5
    bpy.ops.wm.save_mainfile()


@pytest.fixture
def scene(blender, tmp_path):
    """A folder with that file."""
    folder = tmp_path / "scene"
    folder.mkdir()
    blender.call(__file__, "save_scene", {"folder": folder})
    return folder


def save_two_scenes(folder):
    """In the worker: a second scene and an excluded collection with bars of their own."""
    baking.saved_animation("Bar", Path(folder))
    home, shown = bpy.data.collections.new("Away"), bpy.context.scene
    shown.collection.children.link(home)
    bpy.context.view_layer.active_layer_collection = bpy.context.view_layer.layer_collection.children["Away"]
    baking.animated("Excluded")
    bpy.context.window.scene = bpy.data.scenes.new("Other")
    baking.animated("Elsewhere")
    bpy.context.window.scene = shown
    bpy.context.view_layer.layer_collection.children["Away"].exclude = True
    shown.frame_end = 3
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(folder) / "two.blend"))


def test_objects_that_are_left_out_are_named(blender, command, tmp_path):
    blender.call(__file__, "save_two_scenes", {"folder": tmp_path})
    done = command("bake", "-i", tmp_path / "two.blend")
    assert "left out, in another scene or a collection that is excluded: Elsewhere, Excluded" in done.stderr
    assert [path.name for path in (tmp_path / "cache").iterdir()] == ["two~Scene~Bar.pc2"]
    assert "left out" not in command("bake", "-i", tmp_path / "two.blend", "--objects", "Bar").stderr


def save_scenes_with_it_disabled(folder):
    """In the worker: the same with shape keys, elsewhere; shown, or disabled by itself or its collection."""
    bar, _ = baking.saved_animation("Bar", Path(folder))
    bar.location.y += 3.0
    root = bpy.data.objects.new("Root", None)  # what takes the handles along
    bpy.context.scene.collection.objects.link(root)
    root.location.y = 3.0
    for handle in bar.arapfields.handles:
        handle.empty.parent = root
    bar.shape_key_add(name="Basis")
    key = bar.shape_key_add(name="Wide")
    for point in key.data:
        point.co.y *= 1.5
    key.value = 1.0
    home = bpy.data.collections.new("Home")
    bpy.context.scene.collection.children.link(home)
    home.objects.link(bar)
    bpy.context.scene.collection.objects.unlink(bar)
    bpy.context.scene.frame_end = 5
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(folder) / "shown.blend"))
    for name, item in (("itself", bar), ("collection", home)):
        item.hide_viewport = True
        bpy.ops.wm.save_as_mainfile(filepath=str(Path(folder) / f"{name}.blend"))
        item.hide_viewport = False


def is_disabled_as_it_was(folder, name):
    """In the worker: the output has the object where it was."""
    bpy.ops.wm.open_mainfile(filepath=str(Path(folder) / f"{name}_baked.blend"))
    bar = bpy.data.objects["Bar"]
    assert [home.name for home in bar.users_collection] == ["Home"] and bar.modifiers
    assert bar.hide_viewport == (name == "itself")
    assert bpy.data.collections["Home"].hide_viewport == (name == "collection")


def test_an_object_that_is_disabled_in_viewports_is_baked_as_one_that_is_shown(blender, command, tmp_path):
    blender.call(__file__, "save_scenes_with_it_disabled", {"folder": tmp_path})
    caches = {}
    for name in ("shown", "itself", "collection"):
        for objects in ((), ("--objects", "Bar")):
            command("bake", "-i", tmp_path / f"{name}.blend", "--folder", tmp_path / name, *objects)
            caches[name, objects] = (tmp_path / name / f"{name}~Scene~Bar.pc2").read_bytes()
        command("bake", "-i", tmp_path / f"{name}.blend", "-o", tmp_path / f"{name}_baked.blend")
        blender.call(__file__, "is_disabled_as_it_was", {"folder": tmp_path, "name": name})
    assert len(set(caches.values())) == 1, {key: hash(value) for key, value in caches.items()}


@pytest.mark.slow
def test_parts_in_any_order_make_the_cache_that_one_process_makes(scene, user_folder):
    folder = scene

    def run(*arguments):
        call = [sys.executable, str(ROOT / "blender_scripts/bake.py"), "-i", str(folder / "scene.blend")]
        done = subprocess.run([*call, *map(str, arguments)], env=user_folder, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
        return done

    run("-o", folder / "baked.blend")
    whole, name = (folder / "cache/scene~Scene~Bar.pc2").read_bytes(), "scene~Scene~Bar.pc2"
    assert len(whole) == 32 + 5 * 12 * 386 and (folder / "baked.blend").exists()
    shared = folder / "shared"
    shared.mkdir()
    parts = ["--folder", shared, "--shard"]
    said = run(*parts, "2/3").stdout
    assert "3 of 5 frames to come" in said  # of 2 and 5
    assert not (shared / name).exists()
    frames = sorted((shared / f".{name}.frames").iterdir())
    kept = [path for path in frames if path.name != "lock"]
    kept[0].unlink()  # as if it had been killed before it came to that frame
    stamps = {path: path.stat().st_mtime_ns for path in kept[1:]}
    run(*parts, "3/3"), run(*parts, "2/3")
    assert all(path.stat().st_mtime_ns == stamp for path, stamp in stamps.items())  # solved once
    run(*parts, "1/3")
    assert (shared / name).read_bytes() == whole
    assert [path.name for path in shared.iterdir()] == [name]


def test_an_export_and_what_cannot_be_baked(scene, command):
    folder = scene
    bake = ["bake", "-i", folder / "scene.blend"]
    command(*bake, "-o", folder / "bar.usdc", "--frames", "2-4")
    assert (folder / "bar.usdc").read_bytes()[:8] == b"PXR-USDC"
    for arguments, text in (
        (["-o", folder / "bar.obj"], "unknown extension"),
        (["--frames", "5-1"], "is not A-B"),
        (["--objects", "None"], "no mesh object named None"),
        (["--folder", folder / "gone/too"], "no such folder"),
        (["--folder", folder / "bar.usdc"], f"arapfields: {folder / 'bar.usdc'}: "),
        (["-o", folder / "bar.abc", "--shard", "1/2"], "an exported file has no parts"),
    ):
        done = command(*bake, *arguments, check=False)
        assert done.returncode in (1, 2) and text in done.stderr, (arguments, done.stderr)
    assert np.all([not path.name.startswith(".") for path in folder.iterdir()])


# Flags of contact in Blender without a window: real files in, real files out.


def write(path, vertices, triangles):
    import trimesh

    trimesh.Trimesh(vertices, triangles, process=False).export(path)
    return path


def test_flags_of_contact_hold_a_surface_back(command, tmp_path):
    require_bpy()
    ball, triangles = meshes.sphere(subdivisions=3)
    table = write(tmp_path / "table.ply", ball * [2, 2, 0.2] - [0, 0, 1.4], triangles)
    lower = {"type": "cuboid", "corners": [[None, None, None], [None, None, -0.3]]}
    lower["move"] = {"translate": [0, 0, -0.6]}
    upper = {"type": "cuboid", "corners": [[None, None, 0.6], [None, None, None]]}
    (tmp_path / "pose.json").write_text(json.dumps({"handles": [lower, upper]}))
    run = ["deform", "-i", write(tmp_path / "ball.ply", ball, triangles)]
    run += ["--handles", tmp_path / "pose.json", "--quiet", "--samples", 4000]
    lowest = []
    for flags in ([], ["--ground", -1.1], ["--obstacle", f"{table}:0.05"]):
        command(*run, "-o", tmp_path / "out.ply", *flags)
        lowest.append(read_mesh(tmp_path / "out.ply")[0][:, 2].min())
    assert lowest[0] < -1.3 and lowest[1:] == pytest.approx([-1.1, -1.15], abs=0.02)
    for flags, said in (
        (["--ground", "high"], "is no height"),
        (["--obstacle", "Nobody"], "no object of"),
        (["--obstacle", f"{table}:-1"], "negative"),
    ):
        done = command(*run, "-o", tmp_path / "no.ply", *flags, check=False)
        assert done.returncode == 2 and said in done.stderr
    assert not (tmp_path / "no.ply").exists()
