# SPDX-License-Identifier: GPL-3.0-or-later
"""Files in folders of any name: what is written is read again, by the library and by the command line."""

import numpy as np
import pytest
from support.files.caches import random_motion, write
from support.geometry.cases import bar_handles, bar_samples
from support.programs.cli import run, write_octahedron

import arapfields as af
from arapfields.point_cache import PointCacheReader

# Windows has 260 characters for paths, but for programs that say they take more, as Python and Blender do.
FOLDERS = {
    "spaces": "my files",
    "umlauts": "Grüße Öl",
    "Chinese": "模型 文件",
    "long": "/".join(["x" * 60] * 5),
}


@pytest.fixture(params=FOLDERS)
def folder(request, tmp_path):
    path = tmp_path / FOLDERS[request.param]
    path.mkdir(parents=True)
    return path


def test_what_is_written_is_read_again(folder):
    field = af.deform(bar_samples(300), bar_handles(), af.DeformOptions(iterations=3))
    field.save(folder / "ü 场.safetensors")
    points = bar_samples(50).points
    again = af.DeformationField.load(folder / "ü 场.safetensors")
    assert np.array_equal(again(points), field(points))
    motion = random_motion()
    with PointCacheReader(write(folder / "é.pc2", motion)) as cache:
        assert np.array_equal(cache[1], motion[1])
    with pytest.raises(FileNotFoundError) as error:
        af.DeformationField.load(folder / "不.safetensors")
    assert "不.safetensors" in str(error.value)


def test_the_command_line_takes_them(folder):
    write_octahedron(folder / "ö.obj")
    given = ["--iterations", "3", "--samples", "500", "--style", "cube"]
    assert run("stylize", folder / "ö.obj", "-o", folder / "结果.ply", *given) == 0
    assert (folder / "结果.ply").stat().st_size > 100
    assert sorted(path.name for path in folder.iterdir()) == ["ö.obj", "结果.ply"]
