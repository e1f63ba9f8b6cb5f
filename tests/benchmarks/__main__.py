# SPDX-License-Identifier: GPL-3.0-or-later
"""make bench: every benchmark module's run(), as one table on the screen and in build/bench.json.

python -m tests.benchmarks [module ...]
"""

import importlib
import json
import os
import pkgutil
import platform
import sys
from pathlib import Path

import numpy as np

import arapfields as af

FOLDER = Path(__file__).parent
ROOT = FOLDER.parents[1]


def machine():
    import torch

    lines = Path("/proc/cpuinfo").read_text().splitlines()
    cpu = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), "unknown")
    return {
        "cpu": cpu,
        "threads": af.thread_count(),
        "kernels": af.simd_level(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "torch": torch.__version__,
        "arapfields": af.__version__,
    }


def main(names):
    os.environ.setdefault("ARAPFIELDS_DATA", str(ROOT.parent / "shared" / "data"))
    skip = {"__main__", "timing", "render", "live_cases", "live_picture"}
    known = [module.name for module in pkgutil.iter_modules([str(FOLDER)]) if module.name not in skip]
    unknown = sorted(set(names) - set(known))
    if unknown:
        sys.exit(f"no benchmark {', '.join(unknown)}; there are {', '.join(known)}")
    target = ROOT / "build" / "bench.json"
    target.parent.mkdir(exist_ok=True)
    results = json.loads(target.read_text()) if target.exists() else {}
    results["machine"] = machine()
    print("  ".join(f"{key} {value}" for key, value in results["machine"].items()), flush=True)
    for name in names or known:
        module = importlib.import_module(f"tests.benchmarks.{name}")
        rows = module.run()
        results[name] = rows
        for row in rows:
            print(f"{name:12}", "  ".join(f"{key} {value}" for key, value in row.items()), flush=True)
        target.write_text(json.dumps(results, indent=1))


main(sys.argv[1:])
