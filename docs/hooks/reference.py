# SPDX-License-Identifier: GPL-3.0-or-later
"""The API reference, made from the docstrings of the installed package when the site is built."""

import ast
import importlib
import inspect
import re
import textwrap

from mkdocs.structure.files import File

PAGE = "reference.md"
INTRODUCTION = """# API reference

Written from the docstrings of `arapfields` {version}. Arrays are NumPy, and what is taken for one
(`ArrayLike`) may be anything [like them](extending.md#arrays); `n`, `m`, `p`, `k` are counts. All coordinates
are the mesh's own unless a docstring says *cube*; distances are negative inside. Options go by name,
`DeformOptions(bending=0.1)`, and have a method `to_dict()`. Bad values raise `InvalidInput`, a
`ValueError` that names the argument, what was found and what is allowed; arguments of another type raise
`TypeError`.
"""


# Simplifications of signatures.
PLAIN = {
    r"SupportsInt \| SupportsIndex": "int",
    r"SupportsFloat \| SupportsIndex": "float",
    r'Annotated\[(NDArray)\[numpy\.\w+\](, "[^"]*")*\]': r"\1",
    r"NDArray\[numpy\.\w+\]": "NDArray",
    r"(\w+Options)\([^()]+\)": r"\1()",
}


def on_files(files, config, **_):
    previous = files.get_file_from_path(PAGE)
    if previous:
        files.remove(previous)
    files.append(File.generated(config, PAGE, content=page()))
    return files


def page():
    package = importlib.import_module("arapfields")
    text = [INTRODUCTION.format(version=package.__version__)]
    names = [name for name in in_pipeline_order(package) if not name.startswith("__")]
    kinds = {
        "Functions": [n for n in names if inspect.isroutine(getattr(package, n))],
        "Classes": [n for n in names if is_class(package, n) and not is_error(package, n)],
        "Errors": [n for n in names if is_error(package, n)],
    }
    for title, members in kinds.items():
        text.append(f"## {title}\n")
        text += [entry(getattr(package, name), name) for name in members]
    return "\n".join(text)


def in_pipeline_order(package):
    """Names in the order of the native module, that of the pipeline."""
    native = list(vars(importlib.import_module("arapfields._native")))
    order = {name: i for i, name in enumerate(native)}
    return sorted(package.__all__, key=lambda name: order.get(name, len(order)))


def is_class(package, name):
    return inspect.isclass(getattr(package, name))


def is_error(package, name):
    value = getattr(package, name)
    return inspect.isclass(value) and issubclass(value, BaseException)


def entry(value, name):
    if inspect.isclass(value):
        return "\n".join([f"### {name}\n", body(value), *members(value, name)])
    return "\n".join([f"### {name}\n", signature(value, name), body(value)])


def members(owner, name):
    rows, calls = fields(owner), []
    defaults = owner().to_dict() if name.endswith("Options") else {}
    for key, member in vars(owner).items():
        if key.startswith("_") and key not in {"__init__", "__call__"}:
            continue
        if isinstance(member, property):
            if defaults and key not in defaults:
                continue  # a former name of an option
            given = f"| `{defaults[key]!r}` " if defaults else ""
            rows.append(f"| `{key}` {given}| {one_line(inspect.getdoc(member))} |")
        elif callable(member) or isinstance(member, staticmethod | classmethod):
            call = getattr(owner, key)
            if key == "__init__" and (defaults or "Initialize self" in (call.__doc__ or "")):
                continue
            if key == "to_dict" and defaults:
                continue
            instance = "live" if name == "LiveDeformer" else re.findall(r"[A-Z][a-z]*", name)[-1].lower()
            shown = {"__init__": name, "__call__": instance}.get(key, f"{instance}.{key}")
            if isinstance(member, staticmethod | classmethod):
                shown = f"{name}.{key}"
            calls += [signature(call, shown), body(call)]
    columns = "| option | default | |\n|---|---|---|" if defaults else "| attribute | |\n|---|---|"
    return [*calls, "\n".join([columns, *rows, ""]) if rows else ""]


def fields(owner):
    """Rows of the fields of a class declared in Python, with their descriptions."""
    rows = []
    for kind in reversed(owner.__mro__):
        if not kind.__module__.startswith("arapfields.") or kind.__module__.endswith("_native"):
            continue
        body = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0].body
        for node, following in zip(body, [*body[1:], None], strict=True):
            if not isinstance(node, ast.AnnAssign) or "ClassVar" in ast.unparse(node.annotation):
                continue
            text = isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant)
            rows.append(f"| `{node.target.id}` | {one_line(following.value.value) if text else ''} |")
    return rows


def signature(value, shown):
    """The signature as a code block, from the first line of pybind11's docstring."""
    first = (value.__doc__ or "").split("\n", 1)[0]
    found = re.match(r"\w+(\(.*\))( -> .*)?$", first)
    if found:
        text = f"{shown}{found[1]}{found[2] or ''}"
    else:
        try:
            text = f"{shown}{inspect.signature(value)}"
        except (TypeError, ValueError):
            return ""
    text = re.sub(r"self: [\w.]+(, )?", "", text)
    text = re.sub(
        r"(arapfields\.(_native|arrays|reports|energies)|collections\.abc|numpy\.typing|typing|pathlib|os)\.",
        "",
        text,
    )
    for long, short in PLAIN.items():
        text = re.sub(long, short, text)
    text = re.sub(r" -> (object|None)$", "", text.replace("(self, ", "(").replace("(self)", "()"))
    if len(text) > 100:
        head, tail = text.split("(", 1)
        text = (
            head
            + "(\n    "
            + ",\n    ".join(arguments(tail[: tail.rindex(")")]))
            + ",\n"
            + tail[tail.rindex(")") :]
        )
    return f"```text\n{text}\n```\n"


def arguments(text):
    """Splits at commas outside brackets and quotes."""
    parts, depth, quote = [""], 0, ""
    for letter in text:
        quote = "" if letter == quote else letter if not quote and letter in "'\"" else quote
        depth += 0 if quote else (letter in "([{") - (letter in ")]}")
        if letter == "," and not depth and not quote:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts if part.strip()]


def text_of(value):
    text = inspect.getdoc(value) or ""
    if re.match(r"\w+\(.*\)( -> .*)?$", text.split("\n", 1)[0]):
        text = text.split("\n", 1)[1] if "\n" in text else ""
    return text.strip()


def body(value):
    return re.sub(r"([*_<>|\\])", r"\\\1", text_of(value)) + "\n"


def one_line(text):
    text = re.sub(r"([*_<>|\\])", r"\\\1", text or "")
    return " ".join(text.split())
