# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders the documentation's pictures that are out of date, without a window, each in a separate process.

    python blender_scripts/gallery.py [--output docs/gallery] [--only NAME ...] [--all] [--jobs N] [--list]

A picture is up to date if a hash of its modules, the common modules and the library's sources is unchanged.
manifest.json in the output folder contains the hashes and measured figures. Figures of published shapes need
../shared/data (or ARAPFIELDS_DATA) and are written to out/gallery, outside the repository; those of a window
need a Blender with a window (at_hand.py). Figures with missing requirements are reported and left out.
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
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path[:0] = [str(HERE)]

import at_hand  # noqa: E402
from figures import FIGURES  # noqa: E402

SHARED = ["stage.py", "shapes.py", "creatures.py", "figures/common.py"]
OF_PAGES = ["examples.py", "people.py"]  # modules of figures that run a page's script
LIBRARY = [
    path
    for path in sorted((ROOT / "native").rglob("*"))
    if path.suffix in (".cpp", ".h") and path.parent.name != "bindings"
]


# A tenth of a PNG's size.
SUFFIX = ".webp"
STORED = {"format": "WEBP", "quality": 95, "method": 6}
DRAWN = "drawn.json"  # the pictures and measurements of a figure's process
ONE_AT_A_TIME = threading.Lock()


def with_imports(name, found=()):
    """A module of figures, and the modules of figures that it imports."""
    path = HERE / "figures" / f"{name}.py"
    if path in found:
        return list(found)
    found = [*found, path]
    for other in re.findall(r"^from \.(\w+) import", path.read_text(), re.M):
        found = with_imports(other, found)
    return found


def content_hash(figure):
    """Hash of the library's sources, stage and shapes, and the figure's modules."""
    digest = hashlib.sha256(b"draft" if "STAGE_DRAFT" in os.environ else b"")
    further = [*(HERE / name for name in OF_PAGES), *(ROOT / "docs" / page for page in figure.pages)]
    for path in [*LIBRARY, *(HERE / name for name in SHARED), *with_imports(figure.module)]:
        digest.update(path.read_bytes())
    further += [HERE / "at_hand.py", *at_hand.SCRIPTS] if figure.window else []
    for path in further if figure.pages else ():
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def pictures(folder):
    """The pictures of a figure: sheets, and loops with a still frame of each."""
    return [path for path in folder.iterdir() if path.suffix in (SUFFIX, ".jpg")]


def store(path):
    """Replaces a PNG by a picture in the documentation's format; returns its path."""
    from PIL import Image

    target = path.with_suffix(SUFFIX)
    Image.open(path).convert("RGB").save(target, **STORED)
    path.unlink()
    return target


def draw(name, folder):
    """In the figure's process: renders into an empty folder, and writes the measurements there."""
    figure = next(figure for figure in FIGURES if figure.name == name)
    measured = getattr(importlib.import_module(f"figures.{figure.module}"), f"draw_{name}")(folder)
    for path in folder.glob("*.png"):
        store(path)
    files = sorted(path.name for path in pictures(folder))
    (folder / DRAWN).write_text(json.dumps({"files": files, "measured": measured}))


def is_up_to_date(figure, folder):
    known = read_manifest(folder).get(figure.name, {})
    there = known.get("files") and all((folder / file).exists() for file in known["files"])
    return bool(there) and known.get("hash") == content_hash(figure)


def read_manifest(folder):
    path = folder / "manifest.json"
    return json.loads(path.read_text()) if path.exists() else {}


def take(figure, drawn, folder):
    """Moves the pictures to their place, and updates the manifest."""
    entry = json.loads((drawn / DRAWN).read_text())
    for file in entry["files"]:
        os.replace(drawn / file, folder / file)
    manifest = read_manifest(folder)
    manifest[figure.name] = {"shows": figure.shows, "hash": content_hash(figure), **entry}
    (folder / "manifest.json").write_text(json.dumps(dict(sorted(manifest.items())), indent=1) + "\n")


def bring_up_to_date(figure, folder, force):
    """Renders a figure if necessary, and prints a line; False, with the old pictures, if rendering failed."""
    title = f"{figure.name:16} {figure.shows} ..."
    if is_up_to_date(figure, folder) and not force:
        print(f"{figure.name:16} up to date", flush=True)
        return True
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory(dir=folder, prefix=".") as drawn:
        command = [sys.executable, str(HERE / "gallery.py"), "--draw", figure.name, "--output", drawn]
        made = subprocess.run(command, capture_output=True, text=True)
        if made.returncode:
            print(f"{title} failed\n{made.stdout[-2000:]}{made.stderr[-2000:]}", flush=True)
            return False
        with ONE_AT_A_TIME:
            take(figure, Path(drawn), folder)
    print(f"{title} {time.perf_counter() - begin:.0f} s", flush=True)
    return True


def work_of_children():
    """Processor time of all figures up to now, in seconds."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / "gallery")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME")
    parser.add_argument("--all", action="store_true", help="render what is up to date as well")
    jobs = min(4, os.cpu_count() or 1)
    parser.add_argument(
        "--jobs", type=int, default=jobs, help="figures at a time, but for those that are timed"
    )
    parser.add_argument("--list", action="store_true", help="name the figures and stop")
    parser.add_argument("--draw", help=argparse.SUPPRESS)
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else None)
    if options.draw:
        draw(options.draw, options.output.resolve())
        sys.stdout.flush()
        os._exit(0)  # bpy 4.5 may deadlock at the end of the process
    if options.list:
        print("\n".join(f"{figure.name:16} {figure.shows}" for figure in FIGURES))
        return 0
    unknown = set(options.only) - {figure.name for figure in FIGURES}
    if unknown:
        parser.error(f"no figure {', '.join(sorted(unknown))}; --list names them")
    begin, wanted = time.perf_counter(), []
    for figure in FIGURES:
        if options.only and figure.name not in options.only:
            continue
        folder = (ROOT / "out" / "gallery" if figure.published else options.output).resolve()
        lacking = at_hand.lacking(figure)
        if lacking and (options.all or not is_up_to_date(figure, folder)):
            print(f"{figure.name:16} skipped: {lacking}", flush=True)
            continue
        folder.mkdir(parents=True, exist_ok=True)
        wanted.append((figure, folder))
    done = []
    for timed, jobs in ((True, 1), (False, max(1, options.jobs))):
        if jobs > 1:  # more threads than processors would wait for each other, and busily
            os.environ.setdefault("OMP_NUM_THREADS", str(max(1, (os.cpu_count() or 1) // jobs)))
        with ThreadPoolExecutor(jobs) as pool:
            asked = [
                pool.submit(bring_up_to_date, *one, options.all) for one in wanted if one[0].timed == timed
            ]
            done += [one.result() for one in asked]
    if work_of_children() > 1:
        seconds = time.perf_counter() - begin
        print(f"{'all':16} {seconds:.0f} s, {work_of_children():.0f} s of processor time")
    return 0 if all(done) else 1


if __name__ == "__main__":
    sys.exit(main())
