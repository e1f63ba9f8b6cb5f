# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's layers: which of its folders may import which, and what each thing is done by alone."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ADDON = ROOT / "addon"
# Each folder imports itself and those before it.
ORDER = [
    "core",
    "blender",
    "properties",
    "jobs",
    "tasks",
    "field_modifier",
    "handles",
    "carried",
    "stiffness",
    "surface",
    "results",
    "solver",
    "contact",
    "live",
    "poses",
    "deform",
    "stylize",
    "pin_tool",
    "wrap",
    "skin",
]
ORDER += ["animation", "commands"]
TOP = {
    "__init__",
    "registration",
    "lifecycle",
    "preferences",
    "first_run",
    "menus",
    "names",
    "object_properties",
}
UPWARD = {  # (module, what it imports of a later folder): why
    ("carried/operators.py", "live.sessions"): "a live session forgets what is taken off the list meanwhile",
}
# Operators and panels are what a user meets: only the contents page lists them.
LEAVES = ("operators", "panel")
ALONE = {  # text of a call → the one module that makes it
    "Thread(": "core/runtime/threads.py",
    "app.timers.register": "blender/host.py",
    "event_timer_add": "blender/host.py",
    "draw_handler_add": "lifecycle.py",
    "bpy.app.handlers,": "lifecycle.py",
    "from bpy.app.handlers": "lifecycle.py",
    "translations.register": "blender/language.py",
    "polib": "blender/language.py",
    "register_class": "registration.py",
    "threading.enumerate": "core/runtime/threads.py",
    "status_text_set": "jobs/display.py",
}
CONTAINERS = (ast.List, ast.Dict, ast.Set, ast.ListComp, ast.DictComp, ast.SetComp)
CHANGES = {"append", "add", "clear", "update", "pop", "popitem", "remove", "discard", "extend", "insert"}
CHANGES |= {"setdefault", "appendleft"}
ENDED_ELSEWHERE = {  # state that the lifecycle's STATE does not list, and why
    "icons._collections": "icons.clear, one of the lifecycle's PARTS",
    "icons._drawn": "icons.clear",
    "source_operator.pages": "guide.unregister, by menus.end",
    "__init__._registered": "commands.unregister, one of the lifecycle's PARTS",
    "lifecycle._begun": "lifecycle.unregister itself",
    "lifecycle._drawn": "lifecycle.unregister itself",
    "host._started": "timers.clear, by STATE, which lists the module",
    "object_references.rows": "a flag that is down whenever no row is being chosen",
    "native._state": "the library, which a process loads once",
    "references.is_between": "set within a context manager alone",
    "references.keeps_unused": "set within a context manager alone",
    "references.pushed": "a count of steps that only rises",
    "property_definitions.listeners": "filled while modules are imported, constant afterwards",
}


def modules():
    return sorted(ADDON.rglob("*.py"))


def name(path):
    return path.relative_to(ADDON).as_posix()


def imports(path):
    """Dotted names, below the add-on, of what a module imports from it."""
    package = path.relative_to(ADDON).parent.parts
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = [*package[: len(package) - node.level + 1], *(node.module or "").split(".")]
            base = [part for part in base if part]
            for alias in node.names:
                inner = ADDON.joinpath(*base, alias.name)
                is_module = inner.with_suffix(".py").exists() or inner.is_dir()
                yield ".".join([*base, alias.name] if is_module else base)


def test_folders_import_only_towards_the_core():
    """Operators and panels too; the add-on's own files above all folders use any of them."""
    upward = set()
    for path in modules():
        folder = path.relative_to(ADDON).parts[0]
        if path.parent != ADDON:
            allowed = {*ORDER[: ORDER.index(folder) + 1], *(() if folder == "core" else ("names",))}
            upward |= {(name(path), one) for one in imports(path) if one.split(".")[0] not in allowed}
    assert upward == set(UPWARD) and len(UPWARD) <= 3, upward ^ set(UPWARD)


def test_every_folder_has_its_place():
    folders = {path.name for path in ADDON.iterdir() if path.is_dir() and any(path.glob("*.py"))}
    assert folders == set(ORDER)
    assert {path.stem for path in ADDON.glob("*.py")} <= TOP


def test_nothing_but_the_contents_page_needs_operators_or_panels():
    wrong = []
    for path in modules():
        leaves = [one for one in imports(path) if one.split(".")[-1] in LEAVES]
        if path.stem == "panel":
            leaves = [
                one for one in leaves if not one.endswith(".panel")
            ]  # sections draw parts of one another
        wrong += [f"{name(path)} imports {one}" for one in leaves]
    assert not wrong, wrong


def test_properties_import_only_choices_and_tables():
    allowed = ("core.settings", "names", "blender.property_definitions", "blender.object_references")
    sources = [path for path in modules() if path.stem == "properties" or path.parent.name == "properties"]
    wrong = [
        f"{name(path)} imports {one}"
        for path in sources
        for one in imports(path)
        if not one.startswith(allowed) and "properties" not in one.split(".")
    ]
    assert sources and not wrong, wrong


def test_the_contents_page_lists_all_that_is_registered():
    contents = ast.parse((ADDON / "registration.py").read_text())
    listed = {node.value for node in ast.walk(contents) if isinstance(node, ast.Constant)}
    defining = {
        ".".join(path.relative_to(ADDON).with_suffix("").parts)
        for path in modules()
        if "\nCLASSES = [" in path.read_text() and path.name != "registration.py"
    }
    assert len(defining) > 10 and not defining - listed, defining - listed


@pytest.mark.parametrize("call", ALONE)
def test_each_thing_has_one_way(call):
    assert [name(path) for path in modules() if call in path.read_text()] == [ALONE[call]]


def live_loops(path):
    """The statement loops of a module straight over what Blender holds: "path:line: what"."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.For) and ast.unparse(node.iter).startswith("bpy.data."):
            yield f"{path.relative_to(ROOT)}:{node.lineno}: {ast.unparse(node.iter)}"


def test_nothing_is_done_that_crashes_blender():
    """What a loop deletes, or has Blender delete, is where Blender's own iterator stands. And overrides are
    read without Python's lock (blender/evaluation.py); a window's events are never in one."""
    folders = ("addon", "blender_scripts", "tests/blender", "tests/gui", "tests/support")
    found = [one for folder in folders for path in (ROOT / folder).rglob("*.py") for one in live_loops(path)]
    assert not found, found
    texts = {name(path): path.read_text() for path in modules()}
    assert not [one for one, text in texts.items() if ".temp_override(" in text]
    asking = {one for one, text in texts.items() if "evaluated_depsgraph_get()" in text}
    assert asking == {"blender/evaluation.py", "pin_tool/hover.py", "wrap/landmark_tools.py"}, asking


def names_of(node):
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    return [
        part.id for target in targets if target for part in ast.walk(target) if isinstance(part, ast.Name)
    ]


def changed_names(tree):
    """Names whose contents or attributes a function writes."""
    for function in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
        for node in ast.walk(function):
            if isinstance(node, ast.Global):
                yield from node.names
            if isinstance(node, ast.Call) and getattr(node.func, "attr", "") in CHANGES:
                yield getattr(node.func.value, "id", "")
            if isinstance(node, ast.Subscript | ast.Attribute) and not isinstance(node.ctx, ast.Load):
                yield getattr(node.value, "id", "")


def state_of(path):
    """Module-level names whose values change: containers and objects in lower case, what functions write."""
    tree = ast.parse(path.read_text())
    changed = set(changed_names(tree))
    for node in tree.body:
        value = getattr(node, "value", None)
        called = getattr(getattr(value, "func", None), "id", "")
        changes = isinstance(value, CONTAINERS) or called in ("set", "dict", "list") or called[:1].isupper()
        changes |= called.startswith("_") and called[1:2].isupper()
        for bound in names_of(node) if isinstance(node, ast.Assign | ast.AnnAssign) else ():
            if bound in changed or (changes and not bound.isupper()):
                yield f"{path.stem}.{bound}"


def test_state_is_in_objects_that_the_lifecycle_lists():
    tree = ast.parse((ADDON / "lifecycle.py").read_text())
    direct = {
        alias.name: f"{node.module.split('.')[-1]}.{alias.name}"
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }
    tuples = [node.value for node in tree.body if "STATE" in names_of(node)]
    listed = {ast.unparse(entry) for value in tuples for entry in value.elts}
    listed |= {direct.get(one, one) for one in listed}
    state = {one for path in modules() for one in state_of(path)}
    assert {"style_settings.style_cache", "property_definitions.listeners", "native._state"} <= state
    unlisted = state - listed
    assert unlisted == set(ENDED_ELSEWHERE), unlisted ^ set(ENDED_ELSEWHERE)


def gives_annotations(node):
    return isinstance(node, ast.Assign) and any(
        getattr(target, "id", "") == "__annotations__" for target in node.targets
    )


@pytest.mark.parametrize("path", modules(), ids=name)
def test_a_class_writes_its_annotations_one_way(path):
    """Python 3.14 drops the properties written as annotations where a class gives __annotations__ as well."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ClassDef) and any(map(gives_annotations, node.body)):
            both = [entry.target.id for entry in node.body if isinstance(entry, ast.AnnAssign)]
            assert not both, f"{node.name}: {', '.join(both)} belong in __annotations__"
