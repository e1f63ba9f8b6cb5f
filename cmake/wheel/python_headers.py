# SPDX-License-Identifier: GPL-3.0-or-later
"""Headers of the wheels' Pythons: this system's, else from Debian's packages.

Packages are downloaded by apt-get to a separate folder with separate package lists, without root and without
changes to the system.
"""

import re
import shutil
from pathlib import Path

from platforms import BLENDERS, PYTHONS, ROOT, run

RELEASES = {(3, 11): "bookworm", (3, 13): "trixie", (3, 14): "sid"}  # Debian releases with that Python
KEYRING = "/usr/share/keyrings/debian-archive-keyring.gpg"
FETCHED = ROOT / "build/python-headers"
COPIED = FETCHED / "flat"
SEARCHED = [
    f"{FETCHED}/*/usr/include",
    "/usr/include",
    "/usr/local/include",
    "/opt/*/usr/include",  # a chroot with another release's headers
    "/opt/python/*/include",  # the manylinux containers
    f"{Path.home()}/.pyenv/versions/*/include",
]


def header_version(folder):
    """(major, minor) of the Python.h in `folder`, or None."""
    patchlevel = Path(folder) / "patchlevel.h"
    if not (Path(folder) / "Python.h").exists() or not patchlevel.exists():
        return None
    return tuple(map(int, re.findall(r"#define PY_(?:MAJOR|MINOR)_VERSION\s+(\d+)", patchlevel.read_text())))


def at_hand(version):
    """The folder of a Python's headers on this system, or None."""
    folders = candidates("python{}.{}".format(*version))
    return next((folder for folder in folders if header_version(folder) == version), None)


def candidates(name):
    """Folders that may hold the headers of a Python: those searched, and that of the program in PATH."""
    for pattern in SEARCHED:
        yield from sorted(Path("/").glob(f"{pattern.lstrip('/')}/{name}"))
    try:
        yield Path(run(name, "-c", "import sysconfig; print(sysconfig.get_path('include'))").strip())
    except (OSError, RuntimeError):
        return


def headers(version):
    """Copies a Python's headers to COPIED, with a pyconfig.h for all platforms; returns the path."""
    source = at_hand(version) or fetch(version)
    copy = COPIED / source.name
    if not copy.is_dir():
        shutil.copytree(source, copy, ignore=shutil.ignore_patterns("internal"))
    config = (ROOT / "cmake/wheel/pyconfig.h").read_bytes()
    if (copy / "pyconfig.h").read_bytes() != config:
        (copy / "pyconfig.h").write_bytes(config)
    return copy


def pythons(whole):
    """The Pythons whose headers are to be had: all of them if `whole`, at least Blender's, for the zips."""
    found = []
    for version in PYTHONS:
        try:
            headers(version)
            found.append(version)
        except RuntimeError as error:
            if whole or version in BLENDERS:
                raise
            print(f"left out: {error}", flush=True)
    return found


def mirror():
    """The Debian mirror that this system uses."""
    texts = [path.read_text() for path in Path("/etc/apt").glob("sources.list.d/*.sources")]
    texts += [path.read_text() for path in Path("/etc/apt").glob("sources.list*") if path.is_file()]
    for text in texts:
        match = re.search(r"^(?:URIs:\s*|deb\s+(?:\[.*?\]\s*)?)(https?://\S+/debian)/?\s", text, flags=re.M)
        if match:
            return match[1]
    raise RuntimeError("this system has no Debian mirror")


def options(release, state):
    """Arguments of apt-get for a separate state folder, with one release as its source."""
    for folder in ("lists/partial", "cache/archives/partial", "parts"):
        (state / folder).mkdir(parents=True, exist_ok=True)
    source = state / "sources.list"
    source.write_text(f"deb [signed-by={KEYRING}] {mirror()} {release} main\n")
    settings = {
        "Dir::Etc::SourceList": source,
        "Dir::Etc::SourceParts": state / "parts",
        "Dir::State::Lists": state / "lists",
        "Dir::Cache": state / "cache",
        "APT::Sandbox::User": "root",
        "Acquire::Languages": "none",
        "Acquire::Check-Valid-Until": "false",
    }
    return [text for name, value in settings.items() for text in ("-o", f"{name}={value}")]


def fetch(version):
    """Downloads and unpacks the headers of a Python to FETCHED; returns their folder."""
    if version not in RELEASES:
        raise RuntimeError("no headers of Python {0}.{1}: needs python{0}.{1} in PATH".format(*version))
    package = "libpython{}.{}-dev".format(*version)
    folder = FETCHED / RELEASES[version]
    settings = options(RELEASES[version], folder / "apt")
    try:
        for command in (["update"], ["download", package]):
            run("apt-get", "-q", *settings, *command, cwd=folder)
        (archive,) = folder.glob(f"{package}_*.deb")
        run("dpkg", "-x", archive, folder)
    except (OSError, RuntimeError) as error:
        raise RuntimeError("no headers of Python {}.{}: ".format(*version) + str(error)) from None
    archive.unlink()
    for rest in ("apt", "usr/lib", "usr/share", "usr/bin"):
        shutil.rmtree(folder / rest, ignore_errors=True)
    return at_hand(version)
