# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures deformations of a bar and of the authors' published hand; makes docs/images/hand.webp.

ARAPFIELDS_DATA=folder python docs/examples/hand.py [output.webp]
The folder holds neural_sdf/hand.pt; reading it needs PyTorch. The handles are those of the tests.
"""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt

import arapfields as af

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))
import cases  # noqa: E402

Array = npt.NDArray[np.float64]
Handles = Sequence[af.Handle]

WEIGHTS = [0.0, 1e-3, 1e-2, 1e-1]
THIN_PARTS: dict[str, Any] = dict(
    frequency=4.0, octaves=6, bending=0.1, bending_unit="cube", learning_rate=0.02, iterations=600
)


def solved(samples: af.SurfaceSamples, handles: Handles, **options: Any) -> af.DeformationField:
    return af.deform(samples, handles, af.DeformOptions(width=128, **options))


def trade(samples: af.SurfaceSamples, handles: Handles) -> Array:
    """(4, 2): mean stretch and mean bend for each weight of the bend."""
    fields = [solved(samples, handles, bending=100 * weight, bending_unit="cube") for weight in WEIGHTS]
    return np.array([af.arap_energy(field, samples.points) for field in fields])


def coupling(samples: af.SurfaceSamples) -> dict[str, dict[str, float]]:
    """How far the tips of the other fingers go, in % of the length of the hand, by network and finger."""
    tips = {name: rows for name, rows in cases.fingertips(samples).items() if name != "middle"}
    result = {}
    networks: dict[str, dict[str, Any]] = {"defaults": {}, "finer network": THIN_PARTS}
    for network, options in networks.items():
        field = solved(samples, cases.hand_handles(), **options)
        distance = 100 * np.linalg.norm(field(samples.points) - samples.points, axis=1)
        distance /= np.ptp(samples.points[:, 2])
        result[network] = {name: float(distance[rows].max()) for name, rows in tips.items()}
    return result


def draw_trade(axes: Any, values: Array, title: str) -> None:
    places, right = np.arange(len(WEIGHTS)), axes.twinx()
    (a,) = axes.plot(places, values[:, 0], "o-", color="#c2410c", label="mean stretch")
    (b,) = right.semilogy(places, values[:, 1], "s-", color="#1d4ed8", label="mean bend")
    axes.set_xticks(places, [f"{weight:g}" for weight in WEIGHTS])
    axes.set(xlabel="weight of the bend, λ", ylabel="stretch", title=title)
    axes.set_ylim(bottom=0)
    right.set_ylim(0.1, 10)
    right.set_yticks([0.1, 1, 10], ["0.1", "1", "10"])
    right.set_ylabel("bend")
    axes.legend(handles=[a, b], frameon=False, loc="upper center")


def draw_coupling(axes: Any, moved: dict[str, dict[str, float]]) -> None:
    for k, (network, tips) in enumerate(moved.items()):
        places = np.arange(len(tips)) + 0.38 * k
        axes.bar(places, tips.values(), 0.36, color=["0.7", "#c2410c"][k], label=network)
        axes.set_xticks(places - 0.19, list(tips))
    axes.axhline(2, color="0.3", linewidth=0.8, linestyle=":")
    axes.set_ylim(0, 17)
    axes.set(ylabel="% of the hand's length", title="Way of the other tips")
    axes.legend(frameon=False, loc="upper right", bbox_to_anchor=(1.0, 0.98))


def draw(bar: Array, hand: Array, moved: dict[str, dict[str, float]], output: str | Path) -> None:
    figure, axes = plt.subplots(1, 3, figsize=(13, 3.6), dpi=110)
    draw_trade(axes[0], bar, "Bar, one end turned")
    draw_trade(axes[1], hand, "Hand, one finger moved")
    draw_coupling(axes[2], moved)
    figure.tight_layout()
    figure.savefig(output, pil_kwargs={"quality": 95})


def main(output: str | Path) -> None:
    data = Path(os.environ.get("ARAPFIELDS_DATA", ROOT.parent / "shared" / "data"))
    samples = cases.published_samples(data / "neural_sdf" / "hand.pt")
    bar = trade(cases.bar_samples(6000), cases.bar_handles())
    hand, moved = trade(samples, cases.hand_handles()), coupling(samples)
    print(bar, hand, moved, sep="\n")
    draw(bar, hand, moved, output)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else ROOT / "docs" / "images" / "hand.webp")
