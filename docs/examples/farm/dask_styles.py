# SPDX-License-Identifier: GPL-3.0-or-later
"""Stylizes every mesh of a folder on the workers of a Dask cluster; what is there already is skipped.

python docs/examples/farm/dask_styles.py meshes cubic            on this machine, a worker a processor
python docs/examples/farm/dask_styles.py meshes cubic tcp://head:8786
"""

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from distributed import Client

import arapfields as af

MESHES = (".ply", ".obj", ".stl", ".off")


def stylized(job: tuple[Path, Path]) -> float:
    """The energy reached; the result is there whole or not at all."""
    source, target = job
    mesh = trimesh.load(source, force="mesh", process=False)
    vertices, triangles = np.array(mesh.vertices), np.array(mesh.faces)
    field = af.stylize(
        af.sample_mesh(vertices, triangles, count=5000), "cube", af.StylizeOptions(iterations=100)
    )
    partial = target.with_name(f".{target.stem}.{os.getpid()}{target.suffix}")
    trimesh.Trimesh(field(vertices), triangles, process=False).export(partial)
    partial.replace(target)
    return field.report.energy


def main() -> int:
    source, target = (Path(name).resolve() for name in sys.argv[1:3])
    if not source.is_dir():
        sys.exit(f"{source}: is no folder")
    target.mkdir(parents=True, exist_ok=True)
    meshes = [path for path in sorted(source.iterdir()) if path.suffix.lower() in MESHES]
    if not meshes:
        sys.exit(f"{source}: holds no mesh; {', '.join(MESHES)} are read")
    jobs = [(path, target / path.name) for path in meshes if not path.name.startswith(".")]
    jobs = [job for job in jobs if not job[1].exists()]
    failed = 0
    # Without an address, workers on this machine, one for each processor, a thread each.
    client: Any = Client(sys.argv[3]) if len(sys.argv) > 3 else Client(threads_per_worker=1)
    with client:
        futures = {job[0].name: client.submit(stylized, job, pure=False) for job in jobs}
        for name, future in futures.items():
            error = future.exception()
            failed += error is not None
            text = f"FAILED: {error}" if error is not None else f"energy {future.result():.4f}"
            print(f"{name}: {text}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
