# SPDX-License-Identifier: GPL-3.0-or-later
"""The built extension: installed from its zip as users do, used, removed; beside another torch."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.slow

USE = """
import sys
from importlib.machinery import PathFinder


class FromTheExtension:  # not from the environment that built it, where it may be installed as well
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name == "arapfields":
            return PathFinder.find_spec(name, [p for p in sys.path if {folder!r} in p])


sys.meta_path.insert(0, FromTheExtension)
import bpy
import numpy as np
sys.path[:0] = [{here!r}]
done = bpy.ops.extensions.package_install_files(
    filepath={zip!r}, repo="user_default", enable_on_install=True)
assert done == {{"FINISHED"}}, done
from bl_ext.user_default.arapfields.core import native
assert not native.problem(), native.problem()
import arapfields
assert {folder!r} in arapfields.__file__, arapfields.__file__
import scenes
bar, _, moving = scenes.bar_with_handles()
scenes.decorate(bar)
kept = scenes.everything(bar)
bpy.ops.arapfields.fit(steps=100, width=32, layers=2, near_points=20000)
moving.location.z += 0.3
bpy.ops.arapfields.deform(output="WARP", **scenes.QUICK)
assert scenes.everything(bpy.data.objects["Bar_deformed"]) == kept
scenes.activate(bar)
bpy.ops.arapfields.stylize(style="CUBE", **scenes.QUICK)
scenes.activate(bar)
bpy.ops.arapfields.extract(resolution=32)
assert len(bpy.data.objects["Bar_implicit"].data.polygons) > 100
"""
REMOVE = """
names = [repo.module for repo in bpy.context.preferences.extensions.repos]
bpy.ops.extensions.package_uninstall(repo_index=names.index("user_default"), pkg_id="arapfields")
assert not hasattr(bpy.types.Object, "arapfields")
"""
OTHER_TORCH = """
import torch
x = torch.randn(64, 8, requires_grad=True)
model = torch.nn.Sequential(torch.nn.Linear(8, 32), torch.nn.Softplus(), torch.nn.Linear(32, 1))
optimizer = torch.optim.Adam(model.parameters())
for _ in range(5):
    loss = model(x).square().mean()
    optimizer.zero_grad(); loss.backward(); optimizer.step()
assert torch.isfinite(loss)
"""


@pytest.fixture(scope="session")
def extension(tmp_path_factory):
    """The zip: the one named by ARAPFIELDS_EXTENSION, or built here for this Python."""
    given = os.environ.get("ARAPFIELDS_EXTENSION")
    if given:
        return Path(given)
    import arapfields

    build = Path(arapfields.__file__).parents[2]
    build = build if (build / "CMakeCache.txt").exists() else ROOT / "build/wheel"
    folder = tmp_path_factory.mktemp("dist")
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    command = [sys.executable, str(ROOT / "blender_scripts/build_extension.py"), "--output", str(folder)]
    subprocess.run([*command, "--build", str(build), "--python", python], check=True)
    (path,) = folder.glob("*.zip")
    return path


def run(code, environment, folder, extension):
    here = str(Path(__file__).parent)
    text = code.replace("{here!r}", repr(here)).replace("{zip!r}", repr(str(extension)))
    text = text.replace("{folder!r}", repr(str(folder))).replace("{{", "{").replace("}}", "}")
    environment = {**environment, "PYTHONPATH": here}
    done = subprocess.run([sys.executable, "-c", text], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]


def test_the_zip_is_small_and_whole(extension):
    assert extension.stat().st_size < 200e6
    with zipfile.ZipFile(extension) as archive:
        names = archive.namelist()
        assert archive.testzip() is None
    assert {"blender_manifest.toml", "__init__.py", "LICENSE"} <= set(names)
    assert sum(name.endswith(".whl") for name in names) == 1


@pytest.mark.parametrize("torch", ["without", "before", "after"])
def test_install_use_and_remove(extension, user_folder, tmp_path, torch):
    parts = {
        "without": [USE, REMOVE],
        "before": [OTHER_TORCH, USE, OTHER_TORCH],
        "after": [USE, OTHER_TORCH, "bpy.ops.arapfields.extract(resolution=24)\n"],
    }
    run("\n".join(parts[torch]), user_folder, tmp_path, extension)
    if torch == "without":
        left = [
            p for p in tmp_path.rglob("*") if p.is_file() and "arapfields" in str(p.relative_to(tmp_path))
        ]
        assert [p for p in left if p.suffix in (".so", ".py", ".whl")] == []
