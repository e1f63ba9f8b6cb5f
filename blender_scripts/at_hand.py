# SPDX-License-Identifier: GPL-3.0-or-later
"""What a figure lacks here, before it is tried."""

import os
from pathlib import Path

import windowed

ROOT = Path(__file__).resolve().parents[1]
PEERS = ROOT / "build" / "bench" / "peers"  # what make bench PEERS=path keeps of its results


def data_folder():
    return Path(os.environ.get("ARAPFIELDS_DATA", ROOT.parent / "shared" / "data"))


def lacking(figure):
    """One line; None where the figure can be made."""
    if figure.published and not data_folder().is_dir():
        return f"no published shapes at {data_folder()}"
    if figure.peers and not any(PEERS.glob("moved-*.npz")):
        return "no results of others' code (make bench PEERS=path)"
    return windowed.missing() if figure.window else None
