# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the library for 64-bit ARM with Debian's cross compiler and runs its tests there, under qemu.

python -m tests.arm64 [--all] [--jobs N] [--only reference native python]

Everything lies in build/arm64: a Debian with Python (root), torch's wheel and others for that processor
(site), and the build. Needs root, for debootstrap and chroot, and Debian packages, named where they lack.
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
PROGRAMS = {
    "debootstrap": "debootstrap",
    "aarch64-linux-gnu-g++": "g++-aarch64-linux-gnu",
    "qemu-aarch64-static": "qemu-user-static",
}
BINFMT = Path("/proc/sys/fs/binfmt_misc")
# A processor as in the first Macs with one of Apple's: NEON, without SVE.
PROCESSOR = "neoverse-n1"
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
        packages = "--include=python3,libgomp1,libstdc++6"
        command = ["debootstrap", "--arch=arm64", packages, "bookworm", str(SYSTEM)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        (SYSTEM / ".ready").touch()


def install_wheels():
    if (SITE / ".ready").exists():
        return
    command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--only-binary=:all:"]
    command += ["--python-version", "3.11", "--target", str(SITE)]
    for tag in ("manylinux_2_28", "manylinux_2_27", "manylinux_2_17", "manylinux2014"):
        command += ["--platform", f"{tag}_aarch64"]
    requirements = Path(__file__).with_name("requirements.txt")
    subprocess.run([*command, "-r", str(requirements)], check=True)
    (SITE / ".ready").touch()


def build(jobs):
    tools = Path(sys.executable).parent
    settings = {
        "CMAKE_BUILD_TYPE": "Release",
        "CMAKE_SYSTEM_NAME": "Linux",
        "CMAKE_SYSTEM_PROCESSOR": "aarch64",
        "CMAKE_CXX_COMPILER": "aarch64-linux-gnu-g++",
        "CMAKE_MAKE_PROGRAM": tools / "ninja",
        "Python_EXECUTABLE": sys.executable,
        "PYTHON_MODULE_EXTENSION": ".cpython-311-aarch64-linux-gnu.so",
        "LIBTORCH_DIR": TORCH,
        "ARAPFIELDS_NATIVE_TESTS": "ON",
        "ARAPFIELDS_WERROR": "OFF",  # GCC 12 for ARM warns of Eigen's own memory, wrongly
    }
    if shutil.which("ccache"):
        settings["CMAKE_CXX_COMPILER_LAUNCHER"] = "ccache"
    given = [f"-D{name}={value}" for name, value in settings.items()]
    cmake = [str(tools / "cmake")]
    with (WORK / "build.log").open("w") as log:
        configure = [*cmake, "-S", str(ROOT), "-B", str(BUILD), "-G", "Ninja", *given]
        subprocess.run(configure, check=True, stdout=log)
        targets = ["arapfields", "_native", "python_sources", "native_tests"]
        command = [*cmake, "--build", str(BUILD), "--parallel", str(jobs), "--target", *targets]
        subprocess.run(command, check=True, stdout=log)


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
    command = ["python3", script, str(there), "--samples", str(here), *given]
    if not inside(shlex.join(command), data):
        return False
    rows = compare(here, there)
    for name, difference, allowed in rows:
        print(f"{name:36} differs by {difference:.1e}, allowed {allowed:.0e}")
    return all(difference <= allowed for _, difference, allowed in rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--all", action="store_true", help="the whole of tests/python and tests/addon_core")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="compilers at a time")
    parser.add_argument("--only", nargs="+", choices=["reference", "native", "python"])
    given = parser.parse_args()
    check_programs()
    WORK.mkdir(parents=True, exist_ok=True)
    register()
    install_system()
    install_wheels()
    build(given.jobs)
    data = Path(os.environ.get("ARAPFIELDS_DATA", ROOT.parent / "shared/data"))
    data = data.resolve() if data.is_dir() else None
    files = ["tests/python", "tests/addon_core"] if given.all else []
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
