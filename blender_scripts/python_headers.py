# SPDX-License-Identifier: GPL-3.0-or-later
"""Headers of the Pythons that Blenders ship and this system lacks, from Debian's packages.

python blender_scripts/python_headers.py [--output build/python-headers]

They are downloaded by apt-get into a folder of their own, with lists of packages of their own: no root is
needed and nothing of the system changes. Where that cannot be done, it says so and ends with status 0: the
extension is then built for the Pythons at hand.
"""

import argparse
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "blender_scripts"))

from extension import bindings  # noqa: E402

RELEASES = {(3, 11): "bookworm", (3, 13): "trixie", (3, 14): "sid"}  # Debian's, that have that Python
KEYRING = "/usr/share/keyrings/debian-archive-keyring.gpg"


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
    """apt-get's arguments for a state of its own, with one release as its only source."""
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


def fetch(version, output):
    """Unpacks the headers of one Python below `output`."""
    release = RELEASES[version]
    folder = (output / release).resolve()
    settings = options(release, folder / "apt")
    package = f"libpython{version[0]}.{version[1]}-dev"
    for command in (["update"], ["download", package]):
        done = subprocess.run(
            ["apt-get", "-q", *settings, *command], cwd=folder, capture_output=True, text=True
        )
        if done.returncode:
            last = (done.stderr.strip().splitlines() or ["apt-get failed"])[-1]
            raise RuntimeError(f"{package} of Debian {release}: {last}")
    (archive,) = folder.glob(f"{package}_*.deb")
    subprocess.run(["dpkg", "-x", str(archive), str(folder)], check=True)
    archive.unlink()
    for rest in ("apt", "usr/lib", "usr/share", "usr/bin"):
        shutil.rmtree(folder / rest, ignore_errors=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "build/python-headers")
    wanted = parser.parse_args().output
    found = bindings.find_headers()
    for version in bindings.SERVED:
        name = ".".join(map(str, version))
        if version not in found:
            try:
                fetch(version, wanted)
            except (RuntimeError, OSError, subprocess.CalledProcessError) as error:
                print(f"no headers of Python {name}: {error}")
                continue
        print(f"headers of Python {name}: {bindings.find_headers([])[version]}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
