# SPDX-License-Identifier: GPL-3.0-or-later
"""Our libraries for Linux as the zip has them, and what they ask of the system."""

import re
import shutil
import subprocess

SYSTEM = re.compile(r"^(ld-linux.*|lib(c|m|dl|rt|pthread|gcc_s|stdc\+\+)\.so\.\d+)$")


def printed(*command):
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, check=True).stdout


def stripped(path, folder):
    """A copy in `folder` without the symbols that only a debugger reads."""
    copy = folder / path.name
    if copy != path:
        shutil.copyfile(path, copy)
    copy.chmod(0o755)
    printed("strip", "--strip-unneeded", copy)
    return copy


def needed(path):
    """Names of the libraries that the one at `path` asks the dynamic linker for."""
    return re.findall(r"^\s+NEEDED\s+(\S+)$", printed("objdump", "-p", path), flags=re.M)


def foreign_needs(paths):
    """What the libraries at `paths` need beyond one another and the C and C++ runtime."""
    bundled = {path.name for path in paths}
    needs = {name for path in paths for name in needed(path)}
    return sorted(name for name in needs - bundled if not SYSTEM.match(name))


def missing_symbols(module, library):
    """Our symbols that the binding `module` asks for and `library` does not have."""

    def names(path, which):
        listed = printed("nm", "-D", which, "--format=posix", path)
        return {line.split()[0].split("@")[0] for line in listed.splitlines()}

    wanted = {name for name in names(module, "--undefined-only") if "10arapfields" in name}
    return sorted(wanted - names(library, "--defined-only"))


def glibc_floor(paths):
    """The newest GLIBC_x.y version that any of the libraries asks for, as (x, y)."""
    found = [re.findall(r"\bGLIBC_(\d+)\.(\d+)", printed("objdump", "-T", path)) for path in paths]
    return max([(2, 0), *((int(major), int(minor)) for pairs in found for major, minor in pairs)])
