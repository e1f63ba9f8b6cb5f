# SPDX-License-Identifier: GPL-3.0-or-later
"""Wheels from PyPI that the add-on itself needs, in the versions of requirements.txt."""

import re
import subprocess
import sys

SHIPPED = ("polib",)  # pure Python; reads the translations


def pinned(requirements, name):
    """`name==version` as the text of a requirements file has it; RuntimeError where it is not pinned."""
    found = re.search(rf"^{name}==\S+$", requirements, flags=re.M)
    if not found:
        raise RuntimeError(f"requirements.txt does not pin a version of {name}")
    return found[0]


def dependency_wheels(requirements, folder):
    """Fetches the wheels into `folder`; their paths."""
    wheels = []
    for name in SHIPPED:
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check"]
        command += ["--no-deps", "--only-binary", ":all:", "--dest", str(folder)]
        command.append(pinned(requirements, name))
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"the wheel of {name} cannot be fetched:\n{done.stderr.strip()[-2000:]}")
        wheels += sorted(folder.glob(f"{name}-*-none-any.whl"))
    return wheels
