# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the library for 64-bit ARM with Debian's cross compiler and runs its tests there, under qemu.

python -m tests.arm64 [--all] [--jobs N] [--only reference native python] [--tests FILE ...]

Everything lies in build/arm64: a Debian with Python (root), torch's wheel and others for that processor
(site), and the build. Needs root, for debootstrap and chroot, and Debian packages, named where they lack.
Of the system it changes one thing, until the next start: the kernel hands programs for ARM to qemu.
"""

import argparse
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

from .reference import compare

ROOT = Path(__file__).resolve().parents[2]
WORK = ROOT / "build/arm64"
SYSTEM, SITE, BUILD = WORK / "root", WORK / "site", WORK / "build"
TORCH = SITE / "torch"
HEADERS = SYSTEM / "usr/include/python3.11"
SUZANNE = WORK / "suzanne.npz"  # Blender's monkey, made here: there is no bpy for that processor
PROGRAMS = {
    "debootstrap": "debootstrap",
    "aarch64-linux-gnu-g++": "g++-aarch64-linux-gnu",
    "qemu-aarch64-static": "qemu-user-static",
}
BINFMT = Path("/proc/sys/fs/binfmt_misc")
# A processor as in the first Macs with one of Apple's: NEON, without SVE.
PROCESSOR, LEVEL = "neoverse-n1", "neon"
# Of tests/python, what takes minutes rather than hours under qemu: every kernel, energies, fields, distances,
# extraction, files. --all runs the whole folder and the extension's logic.
PYTHON_TESTS = [
    *("test_arap_energy", "test_bending", "test_gauss_energy", "test_handle_energy", "test_jets"),
    *("test_distance", "test_extraction", "test_mesh_sdf", "test_neural_sdf", "test_radial"),
    *("test_sample_mesh", "test_fields", "test_files", "test_implicit_function", "test_point_cache"),
    *("test_public_calls", "test_stance", "test_exact_handles"),
]


def check_programs():
    missing = [package for program, package in PROGRAMS.items() if not shutil.which(program)]
    if missing:
        sys.exit(f"test-arm64 needs the Debian packages {' '.join(missing)}")
    if os.geteuid() != 0:
        sys.exit("test-arm64 needs root, for debootstrap and chroot")


def register():
    """Has the kernel start programs for ARM by qemu, as Debian's package describes them."""
    if not (BINFMT / "register").exists():
        subprocess.run(["mount", "-t", "binfmt_misc", "binfmt_misc", str(BINFMT)], check=True)
    if not (BINFMT / "qemu-aarch64").exists():
        line = Path("/usr/lib/binfmt.d/qemu-aarch64.conf").read_text().strip()
        (BINFMT / "register").write_text(line)


def install_system():
    if not (SYSTEM / ".ready").exists():
        packages = "--include=python3,libpython3.11-dev,libgomp1,libstdc++6"
        command = ["debootstrap", "--arch=arm64", packages, "bookworm", str(SYSTEM)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        # Debian's pyconfig.h includes the processor's own by a path from /usr/include.
        (HEADERS / "aarch64-linux-gnu").symlink_to("../aarch64-linux-gnu")
        (SYSTEM / ".ready").touch()


def install_wheels():
    requirements = Path(__file__).with_name("requirements.txt")
    ready = SITE / ".ready"
    if ready.exists() and ready.read_text() == requirements.read_text():
        return
    shutil.rmtree(SITE, ignore_errors=True)
    command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--only-binary=:all:"]
    command += ["--python-version", "3.11", "--target", str(SITE)]
    for tag in ("manylinux_2_28", "manylinux_2_27", "manylinux_2_17", "manylinux2014"):
        command += ["--platform", f"{tag}_aarch64"]
    subprocess.run([*command, "-r", str(requirements)], check=True)
    ready.write_text(requirements.read_text())


def build(jobs):
    tools = Path(sys.executable).parent
    settings = {
        "CMAKE_BUILD_TYPE": "Release",
        # Compiled in half the time; the kernels have their -O3 from Targets.cmake.
        "CMAKE_CXX_FLAGS_RELEASE": "-O1 -DNDEBUG",
        "CMAKE_SYSTEM_NAME": "Linux",
        "CMAKE_SYSTEM_PROCESSOR": "aarch64",
        "CMAKE_CXX_COMPILER": "aarch64-linux-gnu-g++",
        "CMAKE_MAKE_PROGRAM": tools / "ninja",
        "Python_EXECUTABLE": sys.executable,
        "Python_INCLUDE_DIR": HEADERS,
        "PYTHON_MODULE_EXTENSION": ".cpython-311-aarch64-linux-gnu.so",
        "LIBTORCH_DIR": TORCH,
        "ARAPFIELDS_NATIVE_TESTS": "ON",
        "ARAPFIELDS_WERROR": "OFF",  # GCC 12 for ARM warns of Eigen's own memory, wrongly
    }
    if shutil.which("ccache"):
        settings["CMAKE_CXX_COMPILER_LAUNCHER"] = "ccache"
    given = [f"-D{name}={value}" for name, value in settings.items()]
    cmake = [str(tools / "cmake")]
    targets = ["arapfields", "_native", "python_sources", "native_tests"]
    commands = [
        [*cmake, "-S", str(ROOT), "-B", str(BUILD), "-G", "Ninja", *given],
        [*cmake, "--build", str(BUILD), "--parallel", str(jobs), "--target", *targets],
    ]
    log = WORK / "build.log"
    print(f"compiling; all output: {log}", flush=True)
    with log.open("w") as output:
        done = all(
            subprocess.run(command, stdout=output, stderr=output).returncode == 0 for command in commands
        )
    if not done:
        sys.exit("\n".join(log.read_text().splitlines()[-40:]))


def inside(command, data):
    """Runs a shell command in that system, in this folder under its own path; whether it succeeded."""
    folders = [ROOT, *([data] if data else [])]
    binds = [
        f"mkdir -p {q(place)} && mount --bind {q(folder)} {q(place)}"
        for folder, place in ((folder, f"{SYSTEM}{folder}") for folder in folders)
    ]
    mounts = [
        *binds,
        f"mount -t proc proc {q(SYSTEM / 'proc')}",
        f"mount -t tmpfs tmpfs {q(SYSTEM / 'tmp')}",
        f"mount --bind /dev {q(SYSTEM / 'dev')}",
    ]
    environment = {
        "PATH": "/usr/bin:/bin",
        "HOME": "/tmp",
        "LANG": "C.UTF-8",
        "QEMU_CPU": PROCESSOR,
        "PYTHONPATH": f"{BUILD / 'python'}:{SITE}",
        "PYTHONDONTWRITEBYTECODE": "1",
        "ARAPFIELDS_DATA": str(data or "/nowhere"),
        "ARAPFIELDS_SUZANNE": str(SUZANNE),
    }
    settings = " ".join(f"{name}={q(value)}" for name, value in environment.items())
    run = f"cd {q(ROOT)} && {command}"
    script = " && ".join([*mounts, f"exec chroot {q(SYSTEM)} /usr/bin/env -i {settings} sh -c {q(run)}"])
    return subprocess.run(["unshare", "--mount", "sh", "-c", script]).returncode == 0


def q(text):
    return shlex.quote(str(text))


def reference(data):
    """Whether the figures of the reference cases agree with this processor's; prints every difference."""
    here, there = WORK / "here.npz", WORK / "there.npz"
    script = "tests/arm64/reference.py"
    given = ["--data", str(data)] if data else []
    subprocess.run([sys.executable, script, str(here), *given], cwd=ROOT, check=True)
    command = ["python3", script, str(there), "--samples", str(here), "--level", LEVEL, *given]
    if not inside(shlex.join(command), data):
        return False
    rows = compare(here, there)
    for name, difference, allowed in rows:
        print(f"{name:36} differs by {difference:.1e}, allowed {allowed:.0e}")
    return all(difference <= allowed for _, difference, allowed in rows)


def write_suzanne():
    code = "import sys, numpy; from support.geometry import meshes; v, f = meshes.suzanne()"
    code += "; numpy.savez(sys.argv[1], v=v, f=f)"
    subprocess.run([sys.executable, "-c", code, str(SUZANNE)], cwd=ROOT / "tests", check=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--all", action="store_true", help="the whole of tests/python and tests/addon_core")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="compilers at a time")
    parser.add_argument("--only", nargs="+", choices=["reference", "native", "python"])
    parser.add_argument(
        "--tests", nargs="+", default=[], help="files of Python tests to run instead of those chosen"
    )
    given = parser.parse_args()
    check_programs()
    WORK.mkdir(parents=True, exist_ok=True)
    register()
    install_system()
    install_wheels()
    build(given.jobs)
    data = Path(os.environ.get("ARAPFIELDS_DATA", ROOT.parent / "shared/data"))
    data = data.resolve() if data.is_dir() else None
    if data is None:
        print("without the published networks: the bunny's figures and the tests that need them are left out")
    write_suzanne()
    files = given.tests or (["tests/python", "tests/addon_core"] if given.all else [])
    files = files or [f"tests/python/{name}.py" for name in PYTHON_TESTS]
    pytest = shlex.join(["python3", "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "not slow", *files])
    steps = {
        "reference": lambda: reference(data),
        "native": lambda: inside(f"{q(BUILD / 'tests/native_tests')} --report_level=short", data),
        "python": lambda: inside(pytest, data),
    }
    failed = [name for name in given.only or steps if not steps[name]()]
    sys.exit(f"failed on 64-bit ARM: {', '.join(failed)}" if failed else 0)


if __name__ == "__main__":
    main()
