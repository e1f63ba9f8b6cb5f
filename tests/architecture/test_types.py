# SPDX-License-Identifier: GPL-3.0-or-later
"""The public names: documented, and in the type stub that the build makes."""

import ast
import inspect
from pathlib import Path

import arapfields

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


def test_all_lists_what_is_there():
    assert len(set(arapfields.__all__)) == len(arapfields.__all__)
    assert all(hasattr(arapfields, name) for name in arapfields.__all__)
