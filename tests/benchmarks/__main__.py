# SPDX-License-Identifier: GPL-3.0-or-later
"""make bench: every section of the benchmarks, as one table on the screen and in build/bench.json.

python -m tests.benchmarks [section ...]; `peers` needs PEERS, a folder with their code.

Without the published networks (ARAPFIELDS_DATA) it runs on shapes of our own. A section that cannot run is
left out and says why; what it found at an earlier run stays in the file.
"""

import importlib
import json
import os
import platform
import sys
import traceback
from pathlib import Path

import numpy as np

import arapfields as af

from . import shapes

TARGET = shapes.ROOT / "build" / "bench.json"
SECTIONS = {  # section: its module, where run_<section>() measures it
    section: module
    for module, sections in {
        "stages": ("distance", "sampling", "extraction", "fit", "jets"),
        "solves": ("deform", "stylize", "contact", "skin"),
        "live": ("live", "live_compare"),
        "conditions": ("backends", "busy", "sizes"),
        "exact": ("exact", "defaults"),
        "peers": ("peers",),
    }.items()
    for section in sections
}


def machine():
    import torch

    lines = Path("/proc/cpuinfo").read_text().splitlines()
    cpu = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), "unknown")
    return {
        "cpu": cpu,
        "threads": af.thread_count(),
        "kernels": af.simd_level(),
        "backend": af.backend(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "torch": torch.__version__,
        "arapfields": af.__version__,
    }


def earlier():
    """The results of earlier runs; {} without any."""
    return json.loads(TARGET.read_text()) if TARGET.exists() else {}


def keep(results):
    """Replaces the file of results atomically, as a run may be stopped at any time."""
    TARGET.parent.mkdir(exist_ok=True)
    partial = TARGET.with_suffix(".partial")
    partial.write_text(json.dumps(results, indent=1))
    partial.replace(TARGET)


def section_of(name):
    module = importlib.import_module(f"tests.benchmarks.{SECTIONS[name]}")
    return getattr(module, f"run_{name}")


def run(name):
    """A section's rows, or the reason why it is left out, and whether that is an error."""
    try:
        return section_of(name)(), None, False
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] in ("tests", "arapfields"):
            raise
        if error.name is None:
            return None, str(error), False
        return None, f"needs the package {error.name}, which is not installed", False
    except Exception as error:
        traceback.print_exc()
        return None, f"{type(error).__name__}: {error}", True


def main(names):
    os.environ.setdefault("ARAPFIELDS_DATA", str(shapes.data()))
    unknown = sorted(set(names) - set(SECTIONS))
    if unknown:
        sys.exit(f"no benchmark {', '.join(unknown)}; there are {', '.join(SECTIONS)}")
    results = earlier()
    results["machine"] = machine()
    print("  ".join(f"{key} {value}" for key, value in results["machine"].items()), flush=True)
    own = [name for name in shapes.OURS if not shapes.is_published(name)]
    if own:
        where = f"no published networks of {', '.join(own)} in {shapes.data()}"
        print(f"{where}: shapes of our own instead", flush=True)
    left_out, broken = {}, False
    for name in names or SECTIONS:
        rows, reason, ours = run(name)
        broken |= ours
        if reason:
            left_out[name] = reason
            continue
        results[name] = rows
        for row in rows:
            print(f"{name:12}", "  ".join(f"{key} {value}" for key, value in row.items()), flush=True)
        keep(results)
    for name, reason in left_out.items():
        stays = ", its earlier figures stay" if name in results else ""
        print(f"left out: {name} ({reason}){stays}", flush=True)
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
