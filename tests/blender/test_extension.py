# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension as a zip in several Blenders, and as a module that a script registers."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from support.blender import blenders
from support.blender.inside import require_bpy
from support.files.splats import splats
from support.geometry import cases

from arapfields.cli import splat_files

# The built extension in several Blenders: installed from its zip, used, removed; beside another torch.

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def extension(tmp_path_factory):
    """The zip: the one named by ARAPFIELDS_EXTENSION, or built here."""
    given = os.environ.get("ARAPFIELDS_EXTENSION")
    if given:
        return Path(given).resolve()
    folder = tmp_path_factory.mktemp("dist")
    for script in ("cmake/wheel/build_wheels.py", "blender_scripts/build_extension.py"):
        subprocess.run([sys.executable, ROOT / script, "linux-x64", "--output", folder], check=True)
    (path,) = folder.glob("*.zip")
    return path


@pytest.fixture
def blender(request, tmp_path):
    program = blenders.find(request.param, tmp_path)
    yield program
    if program.folder != tmp_path:
        shutil.rmtree(program.folder)


@pytest.mark.slow
def test_the_zip_is_small_and_whole(extension):
    assert extension.stat().st_size < 10e6
    with zipfile.ZipFile(extension) as archive:
        names = archive.namelist()
        assert archive.testzip() is None
    assert {"blender_manifest.toml", "__init__.py", "LICENSE"} <= set(names)
    wheels = [Path(name).name.split("-") for name in names if name.endswith(".whl")]
    assert [(wheel[0], wheel[2]) for wheel in wheels] == [
        ("arapfields", "cp311.cp313.cp314"),
        ("polib", "py2.py3"),
    ]


def left_behind(blender):
    """Whatever of the user folder still bears our name."""
    user = blender.folder / "user"
    return [str(p.relative_to(user)) for p in user.rglob("*") if "arapfields" in str(p.relative_to(user))]


@pytest.mark.slow
@pytest.mark.parametrize("torch", ["without", "before", "after"])
@pytest.mark.parametrize("blender", blenders.NAMES, indirect=True)
def test_install_use_and_remove(extension, blender, torch):
    further = []
    if torch != "without":
        further = ["--torch", torch]
        if blender.libtorch:
            further += ["--library", blender.libtorch]
        elif blender.root != Path("/"):
            pytest.skip("no other libtorch there")
        elif subprocess.run([*blender.command, "-c", "import torch"], capture_output=True).returncode:
            pytest.skip("no torch in that Python")
    done = blender.run("installed.py", blender.inside(blender.bring(extension)), *further)
    (used,) = [line for line in done.stdout.splitlines() if line.startswith("USED")]
    print(used)
    assert left_behind(blender) == []


@pytest.mark.slow
@pytest.mark.parametrize("blender", blenders.VERSIONS, indirect=True)
def test_an_enabled_extension_is_upgraded(extension, blender):
    """After its removal the next start knows nothing of it; over itself, in use, and in the next start."""
    command = [*blender.command, "-c", "import bpy; bpy.ops.wm.read_userpref()"]
    starts = blender.call(command, check=False).returncode == 0
    for script, order in (
        ("installed", extension),
        ("upgraded", "gone"),
        ("upgraded", extension),
        ("upgraded", "used"),
    ):
        if order == extension or starts:
            done = blender.run(f"{script}.py", order)
            assert ("UPGRADED" if script == "upgraded" else "USED") in done.stdout
    if not starts:
        pytest.skip("upgraded in use; next starts: this Blender itself crashes where it reads preferences")


@pytest.mark.slow
@pytest.mark.parametrize("blender", blenders.NAMES, indirect=True)
def test_carried_objects_of_all_kinds(extension, blender):
    done = blender.run("installed_carried.py", blender.inside(blender.bring(extension)))
    assert "CARRIED" in done.stdout and "Traceback" not in done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("blender", blenders.NAMES[-1:], indirect=True)
def test_batches_in_blender_itself(extension, blender):
    """As a command of the installed extension and as a script, which skips what the command has done."""
    folder = blender.folder / "in"
    folder.mkdir()
    corners = "\n".join(f"v {x} {y} {z}" for x in (-1, 1) for y in (-1, 1) for z in (-1, 1))
    faces = "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
    for name in ("a.obj", "b.obj"):
        (folder / name).write_text(f"{corners}\n{faces}")
    (folder / "broken.ply").write_text("ply\nnonsense")
    scripts = blender.bring(ROOT / "blender_scripts")
    blender.program(
        "--command",
        "extension",
        "install-file",
        "-r",
        "user_default",
        "-e",
        blender.inside(blender.bring(extension)),
    )
    call = [
        "--style",
        "octahedron",
        "-i",
        blender.inside(folder),
        "-o",
        blender.inside(blender.folder / "out"),
    ]
    call += ["--jobs", "2", "--iterations", "20", "--samples", "1000", "--batch", "100", "--width", "16"]
    done = blender.program("--command", "arapfields", "batch", *call, check=False)
    assert done.returncode == 1 and "3 files: 2 done, 0 skipped, 1 failed" in done.stdout, done.stdout
    script = blender.inside(scripts / "batch.py")
    done = blender.program("-b", "-P", script, "--", *call, "--pattern", "*.obj")
    assert "2 files: 0 done, 2 skipped, 0 failed" in done.stdout, done.stdout
    done = blender.program("-b", "-P", script, "--", *call, "--pattern", "*.obj", "--again")
    assert "2 files: 2 done, 0 skipped, 0 failed" in done.stdout, done.stdout
    assert sorted(p.name for p in (blender.folder / "out").iterdir()) == [
        "a.obj",
        "arapfields-batch",
        "b.obj",
    ]


@pytest.mark.slow
@pytest.mark.parametrize("blender", ["4.5", "4.2"], indirect=True)
def test_a_repository_serves_the_zip(extension, blender, tmp_path):
    """server-generate's index.json is all that Blender needs to list, fetch and install the extension."""
    sys.path.insert(0, str(ROOT / "blender_scripts"))
    from build_extension import extension_tool

    folder = tmp_path / "repository"
    folder.mkdir()
    shutil.copyfile(extension, folder / extension.name)
    extension_tool("server-generate", f"--repo-dir={folder}", "--html")
    done = blender.run("repository.py", f"file://{folder}/index.json")
    assert "SERVED" in done.stdout, done.stdout[-2000:]
    assert left_behind(blender) == []


# The modifier, its inputs and copies of modifiers in all versions of Blender, without the library.


@pytest.mark.parametrize("name", blenders.VERSIONS)
def test_the_modifier_works_without_the_library(name, tmp_path):
    assert "modifier works in" in blenders.find(name, tmp_path).run("modifier_alone.py").stdout


# What we write of splats is read by Blender's own importers, where it has splats of its own.

MOTION = (
    cases.turn([1, 2, 3], 130, (0.2, 0.1, -0.3)) @ cases.shift([0.4, -0.2, 0.1]) @ np.diag([1.5, 1.5, 1.5, 1])
)


@pytest.mark.parametrize("count", [1, 4, 16])
def test_blenders_own_importers_read_the_same_splats(count, tmp_path):
    newest = blenders.find(blenders.VERSIONS[-1], tmp_path)
    posed = splats(500, count).transformed(MOTION)
    arrays = {"position": posed.centers, "rotation": posed.rotations, "scale": posed.scales}
    arrays["radiance:base"] = np.column_stack([posed.harmonics[:, 0], posed.opacities])
    arrays |= {f"radiance:sh_{k - 1}": posed.harmonics[:, k] for k in range(1, count)}
    np.savez(tmp_path / "posed.npz", **arrays)
    paths = [tmp_path / f"posed{suffix}" for suffix in splat_files.FRAMED]
    for path in paths:
        splat_files.write(path, posed)
    done = newest.run("imported_splats.py", tmp_path / "posed.npz", *paths)
    assert "IMPORTED" in done.stdout


@pytest.mark.slow
def test_splats_of_blenders_own_importer_are_posed_by_the_zip(extension, tmp_path):
    newest = blenders.find(blenders.VERSIONS[-1], tmp_path)
    done = newest.run("installed_splats.py", extension, tmp_path)
    assert "POSED" in done.stdout


# A script that registers the add-on in Python's own bpy and simply ends must end.

EXIT_LIMIT = 60  # seconds; it hung for ever where it failed
SCRIPT = "import bpy, addon; addon.register(); bpy.ops.mesh.primitive_monkey_add(); print('end')"


def test_a_script_with_the_addon_ends(user_folder):
    require_bpy()
    command = [sys.executable, "-c", SCRIPT]
    result = subprocess.run(command, env=user_folder, capture_output=True, text=True, timeout=EXIT_LIMIT)
    assert result.returncode == 0, result.stderr
    assert "end" in result.stdout
