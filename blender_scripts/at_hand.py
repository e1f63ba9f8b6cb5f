# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks the requirements of a figure before it is rendered."""

import os
from pathlib import Path

import windowed

ROOT = Path(__file__).resolve().parents[1]
PEERS = ROOT / "build" / "bench" / "peers"  # results of `make bench PEERS=path`


def data_folder():
    return Path(os.environ.get("ARAPFIELDS_DATA", ROOT.parent / "shared" / "data"))


def lacking(figure):
    """A line that names a missing requirement; None if the figure can be rendered."""
    if figure.published and not data_folder().is_dir():
        return f"no published shapes at {data_folder()}"
    if figure.peers and not any(PEERS.glob("moved-*.npz")):
        return "no results of others' code (make bench PEERS=path)"
    return windowed.missing() if figure.window else None
