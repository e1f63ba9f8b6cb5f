# SPDX-License-Identifier: GPL-3.0-or-later
"""The documentation is true: its code runs, links and pictures exist, the site builds without a warning."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import pages  # noqa: E402

# The workflow pages' scripts need their scenes: test_workflows.py runs them.
WITH_CODE = [page for page in pages.PAGES if pages.python_blocks(page) and page.parent.name != "workflows"]


def test_there_is_code_to_run():
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
    sys.path.insert(0, str(pages.ROOT / "docs" / "hooks"))
    import options

    table = options.resolved()
    filled = [options.filled(page.read_text(), table) for page in pages.PAGES]
    assert not [text for text in filled if options.MARK.search(text)]
    assert sum(text.count("| flag | default |") for text in filled) > 5


def test_a_search_finds_each_setting_by_its_label_in_blender():
    sys.path.insert(0, str(pages.ROOT / "docs" / "hooks"))
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
    sys.path.insert(0, str(pages.ROOT / "docs" / "hooks"))
    import headers

    page = headers.on_page_markdown((pages.ROOT / "docs" / "cpp.md").read_text())
    public = list((pages.ROOT / "native" / "include" / "arapfields").glob("*.h"))
    assert len(public) > 15 and all(f"`arapfields/{path.name}`: " in page for path in public)
    assert all(f"`{name}`" in page for name in ("deform", "RadialSolver", "Correspondence", "load_splats"))


def test_the_diagram_is_that_of_the_code():
    sys.path.insert(0, str(pages.ROOT / "docs" / "hooks"))
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
