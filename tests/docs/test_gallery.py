# SPDX-License-Identifier: GPL-3.0-or-later
"""What `make gallery` renders and what it skips, without rendering."""

import json
import subprocess
import sys
import threading
from pathlib import Path

import pages
import pytest

sys.path.insert(0, str(pages.ROOT / "blender_scripts"))

import at_hand
import gallery
from figures import FIGURES

COMMITTED = [figure for figure in FIGURES if not figure.published]


def names(paths):
    return {path.stem for path in paths}


def test_a_picture_depends_on_imported_figure_modules():
    assert {"deforming", "styling", "common"} == names(gallery.with_imports("deforming"))
    assert {"styling", "common"} == names(gallery.with_imports("styling"))


def test_every_figure_has_a_function_that_draws_it():
    for figure in FIGURES:
        source = (pages.ROOT / "blender_scripts/figures" / f"{figure.module}.py").read_text()
        assert f"\ndef draw_{figure.name}(output):" in source, figure.name


def test_every_committed_figure_has_its_pictures_and_figures():
    manifest = json.loads((pages.ROOT / "docs" / "gallery" / "manifest.json").read_text())
    assert set(manifest) == {figure.name for figure in COMMITTED}
    for figure in COMMITTED:
        entry = manifest[figure.name]
        assert entry["files"] and entry["measured"]
        assert all((pages.ROOT / "docs" / "gallery" / file).is_file() for file in entry["files"])


MOST_BYTES = 6_000_000  # of the tree's pictures, meshes and JSON: a clone fetches them all


def test_pictures_meshes_and_json_stay_small():
    kinds = "png", "jpg", "webp", "svg", "json", "obj", "ply", "npz", "blend", "safetensors"
    listed = ["git", "-C", str(pages.ROOT), "ls-files", "-z", *(f"*.{kind}" for kind in kinds)]
    files = subprocess.run(listed, capture_output=True, text=True)
    if files.returncode:
        pytest.skip("not a clone")
    sizes = [(pages.ROOT / name).stat().st_size for name in files.stdout.split("\0") if name]
    assert len(sizes) > 50 and sum(sizes) < MOST_BYTES


def test_missing_measurements_are_left_out():
    from figures.common import measured

    report = {"energy": 0.1234567, "handle_error_mean": 0.0, "preference": None}
    field = type("Field", (), {"report": report})()
    assert measured(field) == {"energy": 0.12346, "handle_error_mean": 0.0}


def test_missing_requirements_are_named(tmp_path, monkeypatch):
    (peers,) = [figure for figure in FIGURES if figure.peers]
    monkeypatch.setattr(at_hand, "PEERS", tmp_path)
    monkeypatch.setenv("ARAPFIELDS_DATA", str(tmp_path / "nowhere"))
    assert "nowhere" in at_hand.lacking(peers)
    monkeypatch.setenv("ARAPFIELDS_DATA", str(tmp_path))
    assert "make bench PEERS=path" in at_hand.lacking(peers)
    (tmp_path / "moved-hand-ours.npz").touch()
    assert at_hand.lacking(peers) is None
    assert at_hand.lacking(COMMITTED[0]) is None


@pytest.fixture
def rendered(monkeypatch):
    """Names of the figures that would have been rendered; rendering itself is refused."""
    calls = []

    def refuse(command, **_):
        calls.append(command[command.index("--draw") + 1])
        return type("Result", (), {"returncode": 1, "stdout": "", "stderr": ""})()

    monkeypatch.setattr(gallery.subprocess, "run", refuse)
    return calls


def test_current_pictures_are_skipped(tmp_path, rendered, capsys):
    figure = COMMITTED[0]
    (tmp_path / "a.png").write_bytes(b"picture")
    entry = {"hash": gallery.content_hash(figure), "files": ["a.png"]}
    (tmp_path / "manifest.json").write_text(json.dumps({figure.name: entry}))
    assert gallery.bring_up_to_date(figure, tmp_path, force=False)
    assert rendered == [] and "up to date" in capsys.readouterr().out
    gallery.bring_up_to_date(figure, tmp_path, force=True)
    assert rendered == [figure.name]


@pytest.mark.parametrize("change", ["picture gone", "other sources", "never made"])
def test_outdated_pictures_are_rendered(tmp_path, rendered, change):
    figure = COMMITTED[0]
    if change != "picture gone":
        (tmp_path / "a.png").write_bytes(b"picture")
    entry = {"hash": gallery.content_hash(figure), "files": ["a.png"]}
    if change == "other sources":
        entry["hash"] = "0" * 16
    manifest = {} if change == "never made" else {figure.name: entry}
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    assert not gallery.bring_up_to_date(figure, tmp_path, force=False)  # what it tried was refused
    assert rendered == [figure.name]


def test_figures_drawn_in_parallel_keep_their_pictures(tmp_path, monkeypatch, capsys):
    """Two at a time, one of which fails after it has drawn: it keeps the picture that it had."""
    good, bad = COMMITTED[:2]
    both = threading.Barrier(2, timeout=30)

    def drawn(command, **_):
        name, folder = command[command.index("--draw") + 1], Path(command[command.index("--output") + 1])
        (folder / f"{name}.png").write_bytes(b"new")
        (folder / gallery.DRAWN).write_text(json.dumps({"files": [f"{name}.png"], "measured": {"a": 1}}))
        both.wait()
        return type("Result", (), {"returncode": int(name == bad.name), "stdout": "", "stderr": "why"})()

    monkeypatch.setattr(gallery.subprocess, "run", drawn)
    (tmp_path / f"{bad.name}.png").write_bytes(b"old")
    arguments = ["--output", str(tmp_path), "--only", good.name, bad.name, "--jobs", "2"]
    monkeypatch.setattr(sys, "argv", ["gallery", "--", *arguments])
    assert gallery.main() == 1
    assert (tmp_path / f"{good.name}.png").read_bytes() == b"new"
    assert (tmp_path / f"{bad.name}.png").read_bytes() == b"old"
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert set(manifest) == {good.name} and manifest[good.name]["files"] == [f"{good.name}.png"]
    assert {path.name for path in tmp_path.iterdir()} == {
        "manifest.json",
        f"{good.name}.png",
        f"{bad.name}.png",
    }
    assert "failed\nwhy" in capsys.readouterr().out
