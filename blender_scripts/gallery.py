# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders the documentation's pictures that are out of date, headless, each in a process of its own.

    python blender_scripts/gallery.py [--output docs/gallery] [--only NAME ...] [--all] [--list]

A picture is up to date when its modules, those that all share and the library's sources are what it was made
with (manifest.json in the output folder, which also holds the figures measured on the way). Figures of
published shapes need ../shared/data (or ARAPFIELDS_DATA) and go to out/gallery, outside the repository; those
of a window need a Blender that has one (windowed.py). What is not at hand is said and left as it is.
"""

import argparse
import hashlib
import importlib
import json
import os
import re
import resource
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path[:0] = [str(HERE)]

import at_hand  # noqa: E402
import windowed  # noqa: E402
from figures import FIGURES  # noqa: E402

SHARED = ["stage.py", "shapes.py", "creatures.py", "menagerie.py", "figures/common.py"]
OF_PAGES = [
    "examples.py",
    "child.py",
    "dressing.py",
    "scanned.py",
    "walking.py",
]  # of figures that run a page's script
LIBRARY = [
    path
    for path in sorted((ROOT / "native").rglob("*"))
    if path.suffix in (".cpp", ".h") and path.parent.name != "bindings"
]


def with_imports(name, found=()):
    """A figure's module and those that it takes from: figures share cases and options."""
    path = HERE / "figures" / f"{name}.py"
    if path in found:
        return list(found)
    found = [*found, path]
    for other in re.findall(r"^from \.(\w+) import", path.read_text(), re.M):
        found = with_imports(other, found)
    return found


def content_hash(figure):
    """Of what a picture is made from: the library's sources, stage and shapes, and its own modules."""
    digest = hashlib.sha256(b"draft" if "STAGE_DRAFT" in os.environ else b"")
    further = [*(HERE / name for name in OF_PAGES), *(ROOT / "docs" / page for page in figure.pages)]
    for path in [*LIBRARY, *(HERE / name for name in SHARED), *with_imports(figure.name)]:
        digest.update(path.read_bytes())
    further += [HERE / "windowed.py", *windowed.SCRIPTS] if figure.window else []
    for path in further if figure.pages else ():
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def data_folder():
    return Path(os.environ.get("ARAPFIELDS_DATA", ROOT.parent / "shared" / "data"))


def pictures(folder):
    """Those of a figure: sheets, and loops with the frame that stands for each."""
    return [path for path in folder.iterdir() if path.suffix in (".png", ".webp", ".jpg")]


def draw(name, folder):
    """In the figure's own process: renders, and leaves the measured figures beside the pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    before = {path: path.stat().st_mtime_ns for path in pictures(folder)}
    figures = importlib.import_module(f"figures.{name}").render(folder)
    files = sorted(p.name for p in pictures(folder) if before.get(p) != p.stat().st_mtime_ns)
    (folder / f".{name}.json").write_text(json.dumps({"files": files, "measured": figures}))


def bring_up_to_date(figure, folder, force):
    """One line on the screen; False where rendering failed."""
    manifest_path = folder / "manifest.json"
    manifest = json.loads(manifest_path.read_text()) if manifest_path.exists() else {}
    known, wanted = manifest.get(figure.name, {}), content_hash(figure)
    there = known.get("files") and all((folder / file).exists() for file in known["files"])
    if there and known.get("hash") == wanted and not force:
        print(f"{figure.name:16} up to date", flush=True)
        return True
    print(f"{figure.name:16} {figure.shows} ...", end=" ", flush=True)
    begin, begin_work = time.perf_counter(), work_of_children()
    command = [sys.executable, str(HERE / "gallery.py"), "--draw", figure.name, "--output", str(folder)]
    made = subprocess.run(command, capture_output=True, text=True)
    if made.returncode:
        print(f"failed\n{made.stdout[-2000:]}{made.stderr[-2000:]}", flush=True)
        return False
    result = folder / f".{figure.name}.json"
    manifest[figure.name] = {"shows": figure.shows, "hash": wanted, **json.loads(result.read_text())}
    result.unlink()
    manifest_path.write_text(json.dumps(dict(sorted(manifest.items())), indent=1) + "\n")
    seconds, work = time.perf_counter() - begin, work_of_children() - begin_work
    print(f"{seconds:.0f} s, {work:.0f} s of processor time", flush=True)
    return True


def work_of_children():
    """Processor seconds of all figures so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / "gallery")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME")
    parser.add_argument("--all", action="store_true", help="render what is up to date as well")
    parser.add_argument("--list", action="store_true", help="name the figures and stop")
    parser.add_argument("--draw", help=argparse.SUPPRESS)
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    if options.draw:
        draw(options.draw, options.output)
        sys.stdout.flush()
        os._exit(0)  # bpy 4.5 may wait forever for a thread of its own while the process ends
    if options.list:
        print("\n".join(f"{figure.name:16} {figure.shows}" for figure in FIGURES))
        return 0
    unknown = set(options.only) - {figure.name for figure in FIGURES}
    if unknown:
        parser.error(f"no figure {', '.join(sorted(unknown))}; --list names them")
    done = []
    for figure in FIGURES:
        if options.only and figure.name not in options.only:
            continue
        if figure.published and not data_folder().is_dir():
            print(f"{figure.name:16} skipped: no published shapes at {data_folder()}", flush=True)
            continue
        if figure.window and (lacking := at_hand.lacking()):
            print(f"{figure.name:16} skipped: {lacking}", flush=True)
            continue
        folder = ROOT / "out" / "gallery" if figure.published else options.output
        folder.mkdir(parents=True, exist_ok=True)
        done.append(bring_up_to_date(figure, folder.resolve(), options.all))
    if work_of_children() > 1:
        print(f"{'all':16} {work_of_children():.0f} s of processor time")
    return 0 if all(done) else 1


if __name__ == "__main__":
    sys.exit(main())
