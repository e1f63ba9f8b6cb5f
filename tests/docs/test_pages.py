# SPDX-License-Identifier: GPL-3.0-or-later
"""The documentation is true: its code and commands run, its links and pictures exist, the site builds."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pages
import pytest
from support.geometry.meshes import sphere
from support.programs.cli import run

HERE = Path(__file__).parent
sys.path.insert(0, str(pages.ROOT / "docs" / "hooks"))
# The workflow pages' scripts need their scenes: test_workflows.py runs them.
WITH_CODE = [page for page in pages.PAGES if pages.python_blocks(page) and page.parent.name != "workflows"]


def test_pages_have_code_to_run():
    assert {"README.md", "scripting.md"} <= {page.name for page in WITH_CODE}


@pytest.mark.parametrize("page", WITH_CODE, ids=pages.name)
def test_code_blocks_run(page, tmp_path):
    run = subprocess.run(
        [sys.executable, str(HERE / "run_blocks.py"), str(page)], cwd=tmp_path, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stdout[-2000:] + run.stderr[-4000:]


@pytest.mark.parametrize("page", pages.PAGES, ids=pages.name)
def test_links_and_pictures_exist(page):
    broken = []
    for target in re.findall(r"\]\(([^)\s]+)\)", pages.without_code(page)):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        if there.name == "reference.md":
            continue  # written while the site is built
        if not there.exists() or (anchor and there.suffix == ".md" and anchor not in pages.anchors(there)):
            broken.append(target)
    assert not broken


def test_messages_of_the_troubleshooting_page_are_in_the_code():
    folders = ("native", "addon", "blender_scripts")
    sources = [
        p
        for folder in folders
        for p in (pages.ROOT / folder).rglob("*.*")
        if p.suffix in (".cpp", ".h", ".py")
    ]
    code = re.sub(r'"\s*\n\s*"', "", "\n".join(path.read_text() for path in sources))
    missing, page = [], (pages.ROOT / "docs" / "troubleshooting.md").read_text()
    for item in re.findall(r"^- (`.*?`)(?:: |$)", page, re.M):
        for message in re.findall(r"`([^`]+)`", item):
            parts = re.split(r"…| i | j ", message)
            missing += [part for part in parts if part.strip() and part.strip() not in code]
    assert not missing


def test_the_tables_of_options_are_filled():
    import options

    table = options.resolved()
    filled = [options.filled(page.read_text(), table) for page in pages.PAGES]
    assert not [text for text in filled if options.MARK.search(text)]
    assert sum(text.count("| flag | default |") for text in filled) > 5


def test_a_search_finds_each_setting_by_its_label_in_blender():
    import options

    table, labels = options.resolved(), set()
    guide = "".join(
        options.filled(page.read_text(), table) for page in pages.PAGES if page.parent.name == "guide"
    )
    for block in table.values():
        labels |= {o["label"] for o in (*block["options"], *block["further"]) if o["name"] in block["panel"]}
    for path in pages.ROOT.glob("addon/**/*.py"):
        if "propert" in path.stem or path.parent.name == "properties" or path.stem == "preferences":
            file = str(path.relative_to(pages.ROOT / "addon").with_suffix(""))
            labels |= {line.split(" | ")[0].strip("| ") for line in options.shown(file).splitlines()[2:]}
    buttons = re.findall(r"^\| (.*?) \| `(\w+)` \| \w", options.buttons(), re.M)
    assert len(labels) > 60 and len(buttons) > 40
    assert not [label for label in (*labels, *dict(buttons)) if label not in guide]


def test_the_list_of_headers_is_filled():
    import headers

    page = headers.on_page_markdown((pages.ROOT / "docs" / "cpp.md").read_text())
    public = list((pages.ROOT / "native" / "include" / "arapfields").glob("*.h"))
    assert len(public) > 15 and all(f"`arapfields/{path.name}`: " in page for path in public)
    assert all(f"`{name}`" in page for name in ("deform", "RadialSolver", "Correspondence", "load_splats"))


def test_the_diagram_is_that_of_the_code():
    import diagram

    assert diagram.PICTURE.read_text() == diagram.svg(), "run python docs/hooks/diagram.py"


@pytest.mark.slow
def test_the_site_builds_without_warnings(tmp_path):
    pytest.importorskip("material", reason="mkdocs-material is installed by make docs")
    # Not --quiet: with it warnings are neither shown nor counted.
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")]
    run = subprocess.run(command, cwd=pages.ROOT, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr[-4000:]
    html = (tmp_path / "site" / "method" / "index.html").read_text()
    assert html.count("<math") > 20 and "arithmatex" not in html
    for built in (tmp_path / "site").rglob("*.html"):
        loaded = re.findall(r'<(?:script|link|img)[^>]*(?:src|href)="(https?:[^"]+)', built.read_text())
        assert not loaded, f"{built.name} loads {loaded}"


# Blocks that are not Python: commands are understood, those of the package are run, C++ is compiled.

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


def test_every_block_has_a_tested_language():
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


# The notebook: ten cells, which run in order and draw a posed mesh.

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


# make demo: its picture is there, and its scene has what the captions say.

MOST = 360  # processor seconds of two cores in three minutes
SEEN = """
import json, os, sys
import bpy, numpy as np
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
graph, found = bpy.context.evaluated_depsgraph_get(), {}
for name in ("Mesh", "Posed", "Styled", "Wrapped"):
    item = bpy.data.objects[name]
    both = (item.data, item.evaluated_get(graph).data)
    rest, now = (np.array([vertex.co for vertex in mesh.vertices]) for mesh in both)
    found[name] = [float(np.linalg.norm(now - rest, axis=1).max()), len(item.modifiers)]
hats = [bpy.data.objects[name] for name in ("Hat", "Hat.001")]
found["hats"] = [list(hat.delta_location) for hat in hats]
print("FOUND" + json.dumps(found), flush=True)
os._exit(0)
"""


@pytest.mark.slow  # a deform, a style and a wrap by their defaults
def test_the_demo_matches_its_captions(tmp_path):
    from PIL import Image

    command = [sys.executable, str(pages.ROOT / "blender_scripts/demo.py"), "--output", str(tmp_path)]
    draft = {**os.environ, "STAGE_DRAFT": "1"}
    before = os.times()
    run = subprocess.run(command, env=draft, capture_output=True, text=True)
    spent = sum(os.times()[2:4]) - sum(before[2:4])
    assert run.returncode == 0, run.stdout[-2000:] + run.stderr[-3000:]
    assert spent < MOST
    picture = Image.open(tmp_path / "demo.png").convert("L")
    assert picture.width > 3 * picture.height and picture.getextrema()[1] - picture.getextrema()[0] > 150
    read = subprocess.run(
        [sys.executable, "-c", SEEN, str(tmp_path / "demo.blend")], capture_output=True, text=True
    )
    (line,) = [line for line in read.stdout.splitlines() if line.startswith("FOUND")]
    found = json.loads(line.removeprefix("FOUND"))
    assert found["Mesh"][0] == 0
    for name in ("Posed", "Styled", "Wrapped"):  # in place: a modifier each, the mesh as it was
        assert found[name][0] > 0.1 and found[name][1] == 1, name
    still, carried = found["hats"]
    assert still == [0, 0, 0] and max(map(abs, carried)) > 0.02
