# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks that are not Python: commands are understood, those of the package are run, C++ is compiled."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pages
import pytest
from support.geometry.meshes import sphere
from support.programs.cli import run

SHORT = {  # flags that keep a run brief: that it runs is tested, not how well it solves
    "fit": "--iterations 40 --width 32 --near-points 4000 --uniform-points 1000",
    "deform": "--iterations 8 --width 32 --resolution 48",
    "stylize": "--iterations 8 --width 32",
    "extract": "--resolution 48",
    "wrap": "--samples 1000",
}


def blocks(page, language):
    return [code for kind, code in pages.FENCE.findall(page.read_text()) if kind == language]


def commands(page):
    """Lines of the page's shell blocks, without comments and variables, continued lines joined."""
    text = "\n".join(blocks(page, "sh")).replace("\\\n", " ")
    text = re.sub(r"^[A-Z]\w*=\S+ ", "", text, flags=re.M)
    return list(filter(None, (shlex.split(line, comments=True) for line in text.splitlines())))


PROGRAMS = {"make", "pip", "arapfields", "blender", "python", ".venv/bin/python", "sbatch", "openjd"}
ALL = [(page, command) for page in pages.PAGES for command in commands(page)]


def test_every_block_is_of_a_kind_that_is_tested():
    kinds = {kind for page in pages.PAGES for kind, _ in pages.FENCE.findall(page.read_text())}
    # "py": code with libraries that the tests do not install.
    assert kinds == {"python", "py", "sh", "json", "cpp", "cmake"}
    assert {words[0] for _, words in ALL} == PROGRAMS


def test_words_of_make_are_in_the_makefile():
    makefile = (pages.ROOT / "Makefile").read_text()
    words = [command[1] for _, command in ALL if command[0] == "make"]
    for page in pages.PAGES:
        words += re.findall(r"`make ([a-z0-9-]+)", page.read_text())
    assert len(words) > 10
    assert not [word for word in words if not re.search(rf"^{word}:", makefile, re.M)]


def blender_arguments(words):
    """The arguments that the extension's parser gets of a command; None where it gets none."""
    if words[:3] == ["blender", "--command", "arapfields"]:
        return words[3:]
    for number, word in enumerate(words):
        script = re.fullmatch(r"blender_scripts/(deform|stylize|batch)\.py", word)
        if script:
            rest = words[number + 1 :]
            return [script[1], *(rest[1:] if rest[:1] == ["--"] else rest)]
    return None


def test_commands_of_blender_are_understood():
    from addon.commands.parser import parse

    understood = 0
    for _, words in ALL:
        named = [word for word in words if re.match(r"(blender_scripts|tests)/.*\.py$", word)]
        assert all((pages.ROOT / name).is_file() for name in named), words
        arguments = blender_arguments(words)
        if arguments is not None:
            parse(arguments)
            understood += 1
        elif words[0] == "blender":
            assert named, words
    assert understood >= 5


def test_commands_of_the_package_run(tmp_path, monkeypatch):
    import trimesh

    page = pages.ROOT / "docs" / "command-line.md"
    (pose,) = blocks(page, "json")
    (tmp_path / "pose.json").write_text(json.dumps(json.loads(pose)))
    vertices, triangles = sphere(1.0, 3)
    mesh = trimesh.Trimesh(np.asarray(vertices) * (0.5, 0.9, 0.9), triangles, process=False)
    mesh.export(tmp_path / "spot.obj")
    mesh.export(tmp_path / "spot_lod2.obj")
    mesh.export(tmp_path / "template.obj")
    mesh.copy().apply_scale(1.1).export(tmp_path / "scan.ply")
    (tmp_path / "hair.obj").write_text("v 0 0.9 0\nv 0 1.1 0\nv 0.1 1.4 0\nl 1 2 3\n")
    done = [words for path, words in ALL if path == page and words[0] == "arapfields"]
    assert len(done) >= 7
    monkeypatch.chdir(tmp_path)
    for words in done:
        assert run(*words[1:], *SHORT.get(words[1], "").split()) == 0, shlex.join(words)
        for name in [word for word in words if Path(word).suffix in (".obj", ".ply", ".npz", ".safetensors")]:
            assert (tmp_path / name).stat().st_size > 0


EXAMPLE = pages.ROOT / "docs" / "examples" / "cpp"
COMPILED = {  # pages, and the sources that their blocks are parts of, which tests compile and run
    "development.md": [pages.ROOT / "tests" / "native" / "test_foreign_field.cpp"],
    "cpp.md": sorted(EXAMPLE.glob("*.cpp")),
}


def test_cpp_blocks_are_compiled():
    """Each is in one of the sources, word by word."""
    assert {page.name for page in pages.PAGES if blocks(page, "cpp")} == set(COMPILED)
    for page in pages.PAGES:
        sources = [" ".join(path.read_text().split()) for path in COMPILED.get(page.name, [])]
        for block in blocks(page, "cpp"):
            assert any(" ".join(block.split()) in source for source in sources), block


def test_cmake_blocks_are_the_examples():
    places = (EXAMPLE, EXAMPLE.with_name("cpp_from_source"))
    source = "\n".join((place / "CMakeLists.txt").read_text() for place in places)
    assert all(block in source for page in pages.PAGES for block in blocks(page, "cmake"))


@pytest.mark.parametrize("name", ["arapfields", "tests.benchmarks.render"])
def test_modules_named_in_the_text_exist(name):
    import importlib.util

    assert any(f"python -m {name}" in page.read_text() for page in pages.PAGES)
    assert importlib.util.find_spec(name)
