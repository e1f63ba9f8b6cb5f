# SPDX-License-Identifier: GPL-3.0-or-later
"""Who installs the source code by mistake reads what to install instead."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

from support.blender.inside import require_bpy

ROOT = Path(__file__).resolve().parents[2]
WITHOUT_LIBRARY = """
import sys


class Nowhere:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name == "arapfields":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


import importlib.util, bpy
real = importlib.util.find_spec
importlib.util.find_spec = lambda name, package=None: None if name == "arapfields" else real(name, package)
sys.meta_path.insert(0, Nowhere)
print(bpy.ops.extensions.package_install_files(
    filepath=sys.argv[1], repo="user_default", enable_on_install=True))
bpy.ops.mesh.primitive_cube_add()
try:
    bpy.ops.arapfields.stylize()
except RuntimeError as error:
    print("OPERATOR", error)
from bl_ext.user_default.arapfields.commands.main import run
print("COMMAND", run(["stylize", "--style", "cube", "-i", "a.ply", "-o", "b.ply"]))
"""


def test_it_is_enabled_and_says_so(tmp_path):
    require_bpy()
    path = tmp_path / "arapfields-main.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for file in (ROOT / "addon").rglob("*"):
            if file.is_file() and "__pycache__" not in file.parts:
                archive.write(file, Path("arapfields-main") / file.relative_to(ROOT))
        archive.write(ROOT / "README.md", "arapfields-main/README.md")
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_LIBRARY, str(path)],
        env={**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "user"), "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0 and "{'FINISHED'}" in done.stdout, done.stdout + done.stderr
    advice = (
        "The native library is not part of this installation. Install arapfields-<version>-<platform>.zip"
    )
    assert f"ARAP Fields: {advice}" in done.stderr  # at once
    assert advice in done.stdout[done.stdout.index("OPERATOR") :]
    assert "COMMAND 2" in done.stdout and f"arapfields: {advice}" in done.stderr
