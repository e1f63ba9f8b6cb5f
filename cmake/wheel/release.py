# SPDX-License-Identifier: GPL-3.0-or-later
"""Completes a release of wheels and zips: source distribution, index.json, licences, checksums.

python cmake/wheel/release.py --output dist
"""

import argparse
import hashlib
import shutil
import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).resolve().parents[2] / "blender_scripts")]

from build_extension import extension_tool  # noqa: E402
from platforms import ROOT, run  # noqa: E402


def build_sdist(output):
    """Builds the source distribution from a copy of the files in git: the build tool would search .venv."""
    tree = ROOT / "build/sdist"
    shutil.rmtree(tree, ignore_errors=True)
    for name in run("git", "-C", ROOT, "ls-files", "-z").split("\0"):
        source, target = ROOT / name, tree / name
        if name and source.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target)
    hook = "import sys; from scikit_build_core.build import build_sdist; print(build_sdist(sys.argv[1]))"
    return output / run(sys.executable, "-c", hook, output, cwd=tree).splitlines()[-1]


def complete(output):
    """Adds the further files; returns them."""
    source = build_sdist(output)
    run(sys.executable, "-m", "twine", "check", "--strict", source, *output.glob("arapfields-*.whl"))
    extension_tool("server-generate", f"--repo-dir={output}", "--html")
    for name in ("LICENSE", "THIRD_PARTY.txt"):
        shutil.copyfile(ROOT / name, output / name)
    sums = output / "SHA256SUMS"
    files = sorted(path for path in output.iterdir() if path.is_file() and path != sums)
    lines = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files]
    sums.write_text("".join(lines))
    return [source, output / "index.json", sums]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "dist")
    try:
        print("\n".join(map(str, complete(parser.parse_args().output.resolve()))))
    except RuntimeError as error:
        sys.exit(f"release: {error}")
