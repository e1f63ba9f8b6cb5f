# SPDX-License-Identifier: GPL-3.0-or-later
"""The notebook: ten cells, which run in order and draw a posed mesh."""

import json
import os
import subprocess
import sys

import pages
import pytest

NOTEBOOK = pages.ROOT / "docs/examples/pose.ipynb"
CHECK = """
from matplotlib.image import imread
picture = imread("posed.png")
dark = picture[:, :, :3].min(axis=2) < 0.95
assert 0.05 < dark.mean() < 0.6, dark.mean()
reached = field(V[[V[:, 2].argmax()]])[0]
assert reached[1] > 0.5, reached
"""


def test_the_notebook_runs(tmp_path):
    pytest.importorskip("matplotlib")
    notebook = json.loads(NOTEBOOK.read_text())
    assert (notebook["nbformat"], notebook["nbformat_minor"], len(notebook["cells"])) == (4, 5, 10)
    assert len({cell["id"] for cell in notebook["cells"]}) == 10
    code = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] for cell in notebook["cells"] if cell["cell_type"] == "code")
    (tmp_path / "run.py").write_text("\n".join([*code, CHECK]))
    environment = {**os.environ, "MPLBACKEND": "agg"}
    run = subprocess.run(
        [sys.executable, "run.py"], cwd=tmp_path, capture_output=True, text=True, env=environment
    )
    assert run.returncode == 0, run.stdout[-2000:] + run.stderr[-4000:]
