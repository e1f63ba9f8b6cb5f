# SPDX-License-Identifier: GPL-3.0-or-later
"""Relative paths on the command line, of a process that another started in a folder of its choice."""

import os
from pathlib import Path
from unittest import mock

import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    import bpy
    from support.blender import scenes

    from addon.commands import files

pytestmark = pytest.mark.in_blender


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
