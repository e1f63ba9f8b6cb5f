# SPDX-License-Identifier: GPL-3.0-or-later
"""What a figure needs before it is rendered: published data, results of others, a Blender with a window."""

import io
import os
import shutil
import subprocess
import zipfile
from pathlib import Path

# Films Blender 5.2 in a window, in another root file system, by chroot. ARAPFIELDS_BLENDER52 names its root
# folder (default /opt/blender52), with Blender, Xvfb, xdotool and ImageMagick inside; the native library
# comes from the extension in dist.

ROOT = Path(__file__).resolve().parents[1]
CHROOT = Path(os.environ.get("ARAPFIELDS_BLENDER52", "/opt/blender52"))
PROJECT = ("addon", "blender_scripts", "native/options", "tests/gui", "tests/support")  # copied into it
SCRIPTS = [ROOT / "blender_scripts/film.py"]
SCRIPTS += [ROOT / "tests/gui" / name for name in ("mouse.py", "stage.py", "window.py")]
SIZE = (880, 620)  # pixels of the window
PATIENCE = 900  # seconds; long enough for a busy machine
SESSION = """
export LIBGL_ALWAYS_SOFTWARE=1 DISPLAY=:97 HOME={0}/home PYTHONPATH={0}/site PYTHONDONTWRITEBYTECODE=1
mkdir -p $HOME
Xvfb $DISPLAY -screen 0 {1}x{2}x24 & screen=$!
sleep 2
timeout {3} blender --python-use-system-env --factory-startup --window-geometry 0 0 {1} {2} \
  --python {0}/project/tests/gui/window.py -- {0}/film film={0}/scene.blend
status=$?
kill $screen
exit $status
"""


def extension():
    """The newest zip for this system; None without one."""
    found = sorted((ROOT / "dist").glob("arapfields-*-linux-x64.zip"), key=lambda path: path.stat().st_mtime)
    return found[-1] if found else None


def missing():
    """A line that names a missing requirement; None if films can be made."""
    if os.geteuid() or not (CHROOT / "usr/bin/blender").exists():
        return f"no Blender with a window in {CHROOT}, or no right to enter it"
    return None if extension() else "no extension in dist (make extension)"


def unpack(target):
    """Unpacks the extension's wheels to a folder to import from."""
    with zipfile.ZipFile(extension()) as outer:
        for name in outer.namelist():
            if name.endswith(".whl"):
                zipfile.ZipFile(io.BytesIO(outer.read(name))).extractall(target)


def record(scene, folder):
    """Runs film.py in a window on a .blend; pictures and film.json are written to a new folder."""
    there = CHROOT / "tmp" / f"arapfields-film-{os.getpid()}"
    shutil.rmtree(there, ignore_errors=True)
    there.mkdir(parents=True)
    try:
        unpack(there / "site")
        for name in PROJECT:
            leave = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / name, there / "project" / name, ignore=leave)
        shutil.copy(scene, there / "scene.blend")
        inside = Path("/") / there.relative_to(CHROOT)
        session = SESSION.format(inside, *SIZE, PATIENCE)
        made = subprocess.run(["chroot", str(CHROOT), "bash", "-c", session], capture_output=True, text=True)
        if not (there / "film/film.json").exists():
            raise RuntimeError(f"no film: {made.stdout[-2000:]}{made.stderr[-2000:]}")
        shutil.copytree(there / "film", folder)
    finally:
        shutil.rmtree(there)


# Checks the requirements of a figure before it is rendered.

PEERS = ROOT / "build" / "bench" / "peers"  # results of `make bench PEERS=path`


def data_folder():
    return Path(os.environ.get("ARAPFIELDS_DATA", ROOT.parent / "shared" / "data"))


def lacking(figure):
    """A line that names a missing requirement; None if the figure can be rendered."""
    if figure.published and not data_folder().is_dir():
        return f"no published shapes at {data_folder()}"
    if figure.peers and not any(PEERS.glob("moved-*.npz")):
        return "no results of others' code (make bench PEERS=path)"
    return missing() if figure.window else None
