# SPDX-License-Identifier: GPL-3.0-or-later
"""Helpers of tests of the command line: runs it; files that it must refuse."""

import os
import sys
import time
from pathlib import Path

import numpy as np

import arapfields
from arapfields.__main__ import main

SMALL_FIT = [
    "--iterations",
    "60",
    "--width",
    "32",
    "--batch",
    "1024",
    "--near-points",
    "4000",
    "--uniform-points",
    "2000",
]
SMALL_SOLVE = ["--iterations", "15", "--batch", "100", "--width", "32", "--samples", "2000"]
HELD_AND_SHIFTED = [
    "--box",
    "-inf,-inf,-inf",
    "inf,inf,-0.3",
    "--box",
    "-inf,-inf,0.3",
    "inf,inf,inf",
    "--shift",
    "0.2,0,0",
]

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def run(*arguments):
    """Runs the command line in this process; returns its exit code."""
    return main([str(argument) for argument in arguments])


def process(*arguments):
    """Arguments of subprocess functions that run the command line, in any folder."""
    places = [str(Path(arapfields.__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    command = [sys.executable, "-m", "arapfields", *(str(argument) for argument in arguments)]
    return command, {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, places))}


def wait_until(process, is_done):
    while process.poll() is None and not is_done():
        time.sleep(0.01)


def wait_until_loaded(running):
    """Waits until a process has begun to load the library."""
    maps = Path(f"/proc/{running.pid}/maps")  # only on Linux
    if maps.exists():
        wait_until(running, lambda: "_native" in maps.read_text())
    else:
        time.sleep(1.0)


def wait_until_at_work(running):
    """Waits until a process has loaded the library and used more processor time since than a start takes."""
    wait_until_loaded(running)
    stat = Path(f"/proc/{running.pid}/stat")
    if not stat.exists():
        time.sleep(2.0)
        return

    def worked():
        user, system = stat.read_text().rpartition(")")[2].split()[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")

    begun = worked()
    wait_until(running, lambda: worked() > begun + 3.0)


def write_octahedron(path, quads=False):
    """Writes an octahedron as OBJ, or a cube of quads."""
    if quads:
        corners = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
        faces = [(1, 3, 4, 2), (5, 6, 8, 7), (1, 2, 6, 5), (3, 7, 8, 4), (1, 5, 7, 3), (2, 4, 8, 6)]
    else:
        corners = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
        faces = [(1, 3, 5), (3, 2, 5), (2, 4, 5), (4, 1, 5), (3, 1, 6), (2, 3, 6), (4, 2, 6), (1, 4, 6)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["f " + " ".join(map(str, face)) for face in faces]
    Path(path).write_text("\n".join(lines) + "\n")
    return Path(path)


def bad_meshes(folder, mesh_file):
    """{defect: path} of unusable mesh files; truncated ones are parts of `mesh_file`."""
    whole = Path(mesh_file).read_bytes()
    header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    contents = {
        "empty.obj": "",
        "empty.ply": "",
        "empty.stl": "",
        "empty.off": "",
        "no_faces.obj": TRIANGLE,
        "no_faces.ply": header + "end_header\n0 0 0\n1 0 0\n0 1 0\n",
        "nan.obj": "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "far.obj": "v 1e200 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "inf.off": "OFF\n3 1 0\ninf 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
        "index.obj": TRIANGLE + "f 1 2 9\n",
        "truncated.off": "OFF\n8 12 0\n0 0 0\n1 0 0\n",
        "truncated.ply": header
        + "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n",
        "garbage.stl": bytes(range(256)) * 3,
        "garbage.ply": bytes(range(256)) * 3,
        "lines.obj": "v 0\nv 1\nv 2\nf 1 2 3\n",
        "short_row.obj": TRIANGLE + "v 1\nf 1 2 4\n",
        "no_columns.obj": b"v -\xe6\x0b\x1e\xe9\nf 1 1 1",  # trimesh reads one vertex without coordinates
        "flat.obj": "v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n",
        "mesh.fbx": TRIANGLE + "f 1 2 3\n",
        "extensionless": TRIANGLE + "f 1 2 3\n",
        f"truncated_real{Path(mesh_file).suffix}": whole[: len(whole) // 4],
        "empty.safetensors": "",
        "garbage.safetensors": bytes(range(256)) * 3,
    }
    paths = []
    for name, content in contents.items():
        path = Path(folder) / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        paths.append(path)
    np.savez(Path(folder) / "foreign.npz", values=np.zeros(3))
    (Path(folder) / "foreign.npz").rename(Path(folder) / "foreign.safetensors")
    (Path(folder) / "directory.obj").mkdir()
    return [
        *paths,
        Path(folder) / "foreign.safetensors",
        Path(folder) / "directory.obj",
        Path(folder) / "missing.obj",
    ]
