# SPDX-License-Identifier: GPL-3.0-or-later
"""The public names: documented, in the type stub, and typed as mypy --strict reads them."""

import ast
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pages
import pytest

import arapfields

# The public names: documented, and in the type stub that the build makes.

STUB = Path(arapfields.__file__).parent / "_native.pyi"


def stub_names():
    tree = ast.parse(STUB.read_text())
    names = {node.name for node in tree.body if isinstance(node, ast.ClassDef | ast.FunctionDef)}
    return names | {node.target.id for node in tree.body if isinstance(node, ast.AnnAssign)}


def test_the_stub_covers_every_native_name():
    from arapfields import _native

    public = {n for n, v in vars(_native).items() if not n.startswith("_") and not inspect.ismodule(v)}
    assert public <= stub_names()


def test_every_public_name_is_documented():
    values = {name: getattr(arapfields, name) for name in arapfields.__all__}
    ours = {n: v for n, v in values.items() if inspect.isclass(v) or inspect.isroutine(v)}
    undocumented = [name for name, v in ours.items() if not (v.__doc__ or "").strip()]
    assert not undocumented


def test_all_lists_existing_names():
    assert len(set(arapfields.__all__)) == len(arapfields.__all__)
    assert all(hasattr(arapfields, name) for name in arapfields.__all__)


# The types that the package ships, by mypy --strict: of the documentation's code, of calls, as revealed.

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "docs"))

PAGES = [page for page in pages.PAGES if pages.python_blocks(page)]

# What the reader of the README has.
README_NAMES = """
import numpy as np
import numpy.typing as npt
V: npt.NDArray[np.float64]
F: npt.NDArray[np.int64]
box_a: npt.NDArray[np.float64]
box_b: npt.NDArray[np.float64]
moved_box_b: npt.NDArray[np.float64]
"""


def module_of(page):
    """A page's Python blocks as one module with the page's line numbers."""
    lines = [""] * len(page.read_text().splitlines())
    for first, code in pages.python_blocks(page):
        lines[first - 1 : first - 1 + len(code.splitlines())] = code.splitlines()
    text = "\n".join(lines) + "\n"
    return README_NAMES.strip().replace("\n", "; ") + text if page.name == "README.md" else text


ARRAY = "numpy.ndarray[Any, numpy.dtype[numpy.floating[numpy._typing._64Bit]]]"
INTEGERS = "numpy.ndarray[Any, numpy.dtype[numpy.signedinteger[numpy._typing._32Bit]]]"

REVEALED = {
    "field(V)": ARRAY,
    "field.jacobian(V)": ARRAY,
    "field.hessian(V)": ARRAY,
    "field.inverse(V)": ARRAY,
    "field": "arapfields._native.DeformationField[arapfields.reports.SolveReport]",
    "field.report": "arapfields.reports.SolveReport",
    "field.report.energy": "float",
    "task.progress": "float",
    "af.__version__": "str",
    "field.report.preference": "float | None",
    "field.report.handles[0].error_mean": "float",
    "field.report.stopped_by": "Literal['iterations', 'time_budget', 'target_error', 'callback', 'diverged']",
    "af.stylize(samples, 'cube')": "arapfields._native.DeformationField[arapfields.reports.SolveReport]",
    "af.train_inverse(field, samples).report": "arapfields.reports.InverseReport",
    "live.solve()": "arapfields._native.RadialField",
    "live.solve().report": "arapfields.reports.LiveReport",
    "sdf(V)": ARRAY,
    "sdf.gradient(V)": ARRAY,
    "af.MeshSdf(V, F)(V)": ARRAY,
    "af.MeshSdf(V, F).gradient(V)": ARRAY,
    "sdf.report": "arapfields.reports.FitReport",
    "af.signed_distance(V, F, V)": ARRAY,
    "af.sample_surface(sdf).report": "arapfields.reports.SampleReport",
    "samples.points": ARRAY,
    "mesh": "tuple[{array}, {integers}, fallback={extraction}]",
    "mesh.vertices": ARRAY,
    "mesh.triangles": INTEGERS,
    "mesh[0]": ARRAY,
    "mesh.report": "arapfields.reports.ExtractionReport",
    "af.extract_deformed(sdf, field).report": "arapfields.reports.DeformedExtractionReport",
    "options.field": "Literal['auto', 'radial', 'neural', 'invertible']",
    "options.optimizer": "Literal['muon', 'adam']",
    "options.bending": "float",
    "options.iterations": "int",
    "options.exact_handles": "bool",
    "af.PointHandle(V[0], V[1]).target": ARRAY,
    "af.RegionHandle([1], V, V).samples": "list[int]",
    "af.arap_energy(field, V)": "tuple[float, float]",
    "iteration.terms": "typing.Mapping[str, float]",
    "jets.jacobians": ARRAY,
    "af.sdf_grid(sdf, 8)[0]": "numpy.ndarray[Any, numpy.dtype[numpy.floating[numpy._typing._32Bit]]]",
}

WRONG = [
    ("af.DeformOptions(field='fast')", "arg-type"),
    ("af.DeformOptions(bendin=1.0)", "call-arg"),
    ("af.deform(samples, [], options, task)", "call-arg"),
    ("af.deform(samples, [5])", "list-item"),
    ("af.stylize(samples, 'cubic')", "arg-type"),
    ("af.extract_surface(V)", "arg-type"),
    ("field.report.enery", "attr-defined"),
    ("task.no_such_method()", "attr-defined"),
    ("field(V).shape.no", "attr-defined"),
    ("af.fit_sdf(V, object())", "arg-type"),
]

SUBJECTS = """
import arapfields as af
import numpy as np
import numpy.typing as npt
Array = npt.NDArray[np.float64]
def reveals(V: Array, F: npt.NDArray[np.int32], samples: af.SurfaceSamples, sdf: af.NeuralSdf,
            live: af.LiveDeformer, options: af.DeformOptions, iteration: af.Iteration, jets: af.Jets) -> None:
    field = af.deform(samples, [af.CuboidHandle(V, V)], options)
    mesh = af.extract_surface(sdf, 64)
    task = af.Task()
"""


def plain(text):
    """A type without what numpy's versions call it: an array by its numbers, and no marks of builtins."""
    text = re.sub(r"builtins\.|typing\.|\?|\*", "", text)
    array = r"(?:numpy\.)?ndarray\[(?:tuple\[Any, \.\.\.\]|Any), (?:numpy\.)?dtype\[(.*?\]?)\]\]"
    text = re.sub(array, r"array<\1>", text)
    kinds = {"float64": ("floating", 64), "float32": ("floating", 32), "int32": ("signedinteger", 32)}
    for name, (kind, bits) in kinds.items():
        long = rf"array<(?:numpy\.)?(?:{kind}\[[\w.]*_{bits}Bit\]|{name})>?>"
        text = re.sub(long, f"array<{name}>", text)
    return re.sub(r"Literal\[([^\]]*)\]", lambda m: " | ".join(f"<{x}>" for x in m[1].split(", ")), text)


@pytest.fixture(scope="module")
def checked(tmp_path_factory):
    """File name → lines that mypy --strict writes about it; all files in one run, which reads numpy once."""
    folder = tmp_path_factory.mktemp("typed")
    files = {"calls": ROOT / "tests" / "python" / "test_public_calls.py"}
    files |= {f"example_{path.stem}": path for path in (ROOT / "docs" / "examples").glob("*.py")}
    texts = {re.sub(r"\W", "_", pages.name(page)): module_of(page) for page in PAGES}
    texts["reveals"] = SUBJECTS + "".join(f"    reveal_type({expression})\n" for expression in REVEALED)
    texts["wrong"] = SUBJECTS + "".join(f"    {call}\n" for call, _ in WRONG)
    for name, text in texts.items():
        files[name] = folder / f"{name}.py"
        files[name].write_text(text)
    # Packages without types (bpy, matplotlib) are taken as they come, and torch, of which it would read all.
    (folder / "mypy.ini").write_text("[mypy]\n[mypy-torch.*]\nfollow_imports = skip\n")
    command = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", "--ignore-missing-imports"]
    command += ["--cache-dir", str(ROOT / "build" / "mypy"), *map(str, files.values())]
    environment = {k: v for k, v in os.environ.items() if k not in ("MYPYPATH", "PYTHONPATH")}
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, env=environment)
    assert done.returncode == 1 and not done.stderr, done.stdout + done.stderr  # what is wrong is found
    lines = done.stdout.splitlines()
    return {name: [line for line in lines if f"{path.stem}.py:" in line] for name, path in files.items()}


@pytest.mark.parametrize("page", PAGES, ids=pages.name)
def test_the_documentations_code_passes_mypy_strict(checked, page):
    assert not checked[re.sub(r"\W", "_", pages.name(page))]


@pytest.mark.parametrize("name", ["example_curves", "example_hand", "calls"])
def test_examples_and_public_calls_pass_mypy_strict(checked, name):
    assert not checked[name]


@pytest.mark.parametrize("expression", REVEALED)
def test_revealed_types_are_exact(checked, expression):
    types = [re.search(r'Revealed type is "(.*)"', line)[1] for line in checked["reveals"]]
    expected = REVEALED[expression].format(
        array=ARRAY,
        integers=INTEGERS,
        extraction="arapfields.reports.Extraction[arapfields.reports.ExtractionReport]",
    )
    assert plain(dict(zip(REVEALED, types, strict=True))[expression]) == plain(expected)


@pytest.mark.parametrize("number", range(len(WRONG)), ids=[call for call, _ in WRONG])
def test_mistakes_are_found(checked, number):
    line = SUBJECTS.count("\n") + 1 + number
    errors = [text for text in checked["wrong"] if f"wrong.py:{line}:" in text and "error" in text]
    assert any(f"[{WRONG[number][1]}]" in text for text in errors), errors


def annotations():
    """(place, annotation) of every argument and result in the stub."""
    for node in ast.walk(ast.parse(STUB.read_text())):
        if isinstance(node, ast.FunctionDef):
            every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            for argument in every:
                if argument.annotation is not None:
                    yield f"{node.name}({argument.arg})", ast.unparse(argument.annotation)
            if node.returns is not None:
                yield f"{node.name} ->", ast.unparse(node.returns)


def test_the_stub_says_any_only_where_anything_is_meant():
    allowed = {"to_dict ->"}
    vague = [(where, what) for where, what in annotations() if "Any" in what and where not in allowed]
    assert not vague
    loose = ("tuple", "dict", "list", "numpy.ndarray")
    pickling = ("__getstate__", "__setstate__", "__deepcopy__")  # Python's own protocol, of any contents
    assert not [w for w, what in annotations() if what in loose and not w.startswith(pickling)]


def test_the_stub_lists_the_library_s_styles():
    alias = re.search(r"^StyleName: typing\.TypeAlias = typing\.Literal\[(.*)\]$", STUB.read_text(), re.M)
    assert re.findall(r"'([^']+)'", alias[1]) == arapfields.style_names()


def test_the_marker_ships():
    assert (STUB.parent / "py.typed").exists()
