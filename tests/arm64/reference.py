# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of a few reference cases, to be computed on two processors and compared.

python tests/arm64/reference.py OUTPUT.npz [--samples OTHER.npz] [--data ARAPFIELDS_DATA] [--level neon]
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

# Largest differences allowed between two processors, as shares of a figure's largest entry: sums of doubles
# in another order; networks, and the multipoles of winding numbers, in single precision; what the many steps
# of a solve make of that (AVX-512 and SSE2 on one processor differ by 2e-4).
ROUNDING, SINGLE, SOLVED = 1e-11, 2e-5, 2e-3
ALLOWED = {
    "distances of a torus": ROUNDING,
    "winding numbers of a torus": SINGLE,
    "extraction vertices of a torus": ROUNDING,
    "energy of jets": ROUNDING,
    "cotangents of that energy": ROUNDING,
    "distances of the bunny's network": SINGLE,
    "extraction vertices of the bunny": SINGLE,
    "energy of the bunny's deform": SOLVED,
    "vertices of the bunny's deform": SOLVED,
}
SAMPLES = "samples"  # what the solve starts from: the same on both


def torus_figures(af, meshes):
    """Distances, winding numbers and a marched surface of a mesh, in double precision."""
    V, F = meshes.torus(around=24, tube=12)
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (2000, 3))
    return {
        "distances of a torus": af.signed_distance(V, F, points),
        "winding numbers of a torus": af.winding_number(V, F, points),
        "extraction vertices of a torus": af.extract_surface(af.MeshSdf(V, F), 32)[0],
    }


def energy_figures(testing):
    """The energy of jets whose rotations are well defined, and its cotangents."""
    jets = 0.15 * np.random.default_rng(1).normal(size=(10, 4000, 3))
    jets[1:4] += np.eye(3)[:, None, :]
    stretch, bend, cotangents = testing.arap_energy(jets, 1.0, 0.7)
    return {"energy of jets": np.array([stretch, bend]), "cotangents of that energy": cotangents}


def bunny_figures(af, cases, network, data, samples):
    """A published network, its surface, and the bend of the method's figures, with its samples."""
    sdf = af.NeuralSdf.from_layers(*network.published(data / "neural_sdf" / "bunny.pt").layers)
    points = np.random.default_rng(2).uniform(-1, 1, (2000, 3))
    vertices = af.extract_surface(sdf, 48)[0]
    if samples is None:
        drawn = af.sample_surface(sdf, count=4000, seed=0)
        samples = np.stack([drawn.points, drawn.normals])
    surface = af.SurfaceSamples(*samples, frame=af.Frame([0, 0, 0], 1.0))
    field = af.deform(surface, cases.bunny_handles())
    return {
        "distances of the bunny's network": sdf(points),
        "extraction vertices of the bunny": vertices,
        "energy of the bunny's deform": np.array([field.report.energy]),
        "vertices of the bunny's deform": field(samples[0][:1000]),
        SAMPLES: samples,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output", type=Path)
    parser.add_argument("--samples", type=Path, help="figures whose samples the solve is to start from")
    parser.add_argument("--data", type=Path, help="published networks; without them the bunny is left out")
    parser.add_argument("--level", help="instruction set that the kernels must have been chosen for")
    given = parser.parse_args()
    from support.geometry import cases, meshes
    from support.oracles.network import Network

    import arapfields as af
    from arapfields._native import testing

    print(f"kernels for {af.simd_level()}", flush=True)
    if given.level not in (None, af.simd_level()):
        sys.exit(f"the kernels for {given.level} were not chosen")
    figures = torus_figures(af, meshes) | energy_figures(testing)
    if given.data and given.data.is_dir():
        samples = np.load(given.samples)[SAMPLES] if given.samples else None
        figures |= bunny_figures(af, cases, Network, given.data, samples)
    np.savez(given.output, **figures)
    print(f"{len(figures)} figures in {time.process_time():.0f} s of processor time")


def compare(here, there):
    """[(figure, largest difference as a share of its largest entry, what is allowed)] of two files."""
    first, second, rows = np.load(here), np.load(there), []
    for name, allowed in ALLOWED.items():
        if name in first:
            a, b = first[name], second[name]
            same = a.shape == b.shape
            rows.append((name, np.abs(a - b).max() / np.abs(a).max() if same else np.inf, allowed))
    return rows


if __name__ == "__main__":
    main()
