# SPDX-License-Identifier: GPL-3.0-or-later
"""Other Blender versions than this environment's bpy; `make blenders` installs those on PyPI.

ARAPFIELDS_BLENDERS   folder of virtual environments with a bpy each, by versions.txt (default build/blenders)
ARAPFIELDS_BLENDER52  root folder of a system with a Blender 5.2 (default /opt/blender52), entered by chroot
"""

import importlib.util
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from support.blender.inside import require_bpy

ROOT = Path(__file__).resolve().parents[3]
SUPPORT = ROOT / "tests/support"
FOLDER = Path(os.environ.get("ARAPFIELDS_BLENDERS", ROOT / "build/blenders"))
CHROOT = Path(os.environ.get("ARAPFIELDS_BLENDER52", "/opt/blender52"))
LINES = (SUPPORT / "blender/versions.txt").read_text().splitlines()
PYTHONS = dict(line.split() for line in LINES if not line.startswith("#"))  # {version: its Python}
OWN = "4.5"  # this environment's
VERSIONS = [OWN, *(version for version in PYTHONS if version != OWN)]
NAMES = [*VERSIONS, "4.2 with NumPy 2", "5.2 in its window's build"]


@dataclass
class Blender:
    """One Blender: how to run scripts in it, and the folder of its user settings and files."""

    command: list
    folder: Path  # for user settings and files, as a path of this system
    root: Path = Path("/")  # root of the system that it runs in
    libtorch: str = ""  # path of another libtorch_cpu.so there
    environment: dict = field(default_factory=dict)

    def inside(self, path):
        """The path within that Blender's root."""
        return str(Path("/") / path.relative_to(self.root))

    def bring(self, path):
        """Copies the file to where that Blender can read it; returns that path."""
        if self.root == Path("/"):
            return path
        copy = self.folder / path.name
        shutil.copytree(path, copy) if path.is_dir() else shutil.copyfile(path, copy)
        return copy

    def run(self, script, *arguments, check=True):
        """Runs a script of this folder."""
        command = [*self.command, self.inside(self.bring(SUPPORT) / "blender" / script)]
        command += ["--"] if "--python" in self.command else []
        return self.call([*command, *arguments], check)

    def program(self, *arguments, check=True):
        """Runs the Blender program with the user's extensions."""
        return self.call([*self.command[: self.command.index("blender") + 1], *arguments], check)

    def call(self, command, check):
        user = self.folder / "user"
        user.mkdir(exist_ok=True)
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "TMPDIR": self.inside(self.folder)}
        environment |= {"BLENDER_USER_RESOURCES": self.inside(user), "PYTHONPATH": "", **self.environment}
        done = subprocess.run(
            [*map(str, command)], env=environment, capture_output=True, text=True, timeout=900
        )
        if check and done.returncode:
            pytest.fail(f"status {done.returncode}\n{done.stdout[-3000:]}{done.stderr[-4000:]}")
        return done


def python_of(name):
    python = FOLDER / name / "bin/python"
    if not python.exists():
        pytest.skip(f"no Blender {name} at {FOLDER / name} (make blenders)")
    return python


def find(name, folder):
    """The Blender of that name; skips the test if it is not installed."""
    if name == OWN:
        require_bpy()
        return Blender([sys.executable], folder)
    if name == "4.2 with NumPy 2":
        numpy = FOLDER / "numpy2"
        if not numpy.is_dir():
            pytest.skip(f"no NumPy 2 at {numpy} (make blenders)")
        return Blender([str(python_of("4.2"))], folder, environment={"PYTHONPATH": str(numpy)})
    if PYTHONS.get(name) == PYTHONS[OWN]:
        return Blender([str(python_of(name))], folder)
    if name in PYTHONS:  # PyPI's torch for its Python is large: our environment's library is loaded instead
        torch = importlib.util.find_spec("torch")
        library = str(Path(torch.origin).parent / "lib/libtorch_cpu.so") if torch else ""
        return Blender([str(python_of(name))], folder, libtorch=library)
    if os.geteuid() or not (CHROOT / "usr/bin/blender").exists():
        pytest.skip(f"no Blender in {CHROOT}, or no right to enter it")
    folder_inside = CHROOT / "tmp" / f"arapfields-{os.getpid()}-{folder.name}"
    shutil.rmtree(folder_inside, ignore_errors=True)
    folder_inside.mkdir(parents=True)
    command = ["chroot", str(CHROOT), "blender", "--background", "--factory-startup"]
    command += ["--python-exit-code", "1", "--python"]
    libtorch = CHROOT / "torch/lib/libtorch_cpu.so"
    return Blender(command, folder_inside, CHROOT, "/torch/lib/libtorch_cpu.so" if libtorch.exists() else "")
