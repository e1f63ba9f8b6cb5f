# SPDX-License-Identifier: GPL-3.0-or-later
"""The type stub of the native module: python stubs.py MODULE.pyi, with the built package in reach.

pybind11-stubgen writes it from the signatures; what a signature cannot say is put right here.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

import arapfields

HEAD = """
StyleName: typing.TypeAlias = typing.Literal[{styles}]
ReportT = typing_extensions.TypeVar(
    "ReportT", bound=arapfields.reports.Report, default=arapfields.reports.SolveReport, covariant=True
)
"""

RULES = [
    # An argument that is None by default takes None.
    (r"(\w+: )([\w.]+|collections\.abc\.\w+\[.*?\]) = None(?=[,)])", r"\1\2 | None = None"),
    # Fields with any report are taken.
    (r": DeformationField(?=[,)| ])", ": DeformationField[arapfields.reports.Report]"),
    # What signatures call object is written as Any.
    (r"(Iteration\], |other: )typing\.Any", r"\1object"),
    # Matrices of one column come back as flat arrays.
    (r'"\[(\w+), 1\]"', r'"[\1]"'),
    # A field's report is of the kind that its maker measures.
    (r"class DeformationField:", "class DeformationField(typing.Generic[ReportT]):"),
    (
        r"class RadialField\(DeformationField\):",
        "class RadialField(DeformationField[arapfields.reports.LiveReport]):",
    ),
    (r"    @staticmethod\n    def __class_getitem__\(.*?\n        \.\.\.\n", ""),
]


def generated(folder):
    """What pybind11-stubgen makes."""
    command = ["-m", "pybind11_stubgen", "--ignore-all-errors", "-o", folder, "arapfields._native"]
    subprocess.run([sys.executable, *command], check=True)
    made = Path(folder) / "arapfields"
    module = made / "_native" / "__init__.pyi"  # a folder where there are submodules
    return (module if module.exists() else made / "_native.pyi").read_text()


def finished(text):
    """The same with the rules applied; ValueError where one finds nothing to do any more."""
    for pattern, replacement in RULES:
        text, count = re.subn(pattern, replacement, text, flags=re.S if "\\n" in pattern else 0)
        if count == 0:
            raise ValueError(f"nothing fits {pattern!r} in the stub any more")
    start = text.index("__all__")
    imports = "import arapfields.arrays\nimport arapfields.energies\nimport arapfields.reports\nimport os\n"
    head = HEAD.format(styles=", ".join(map(repr, arapfields.style_names())))
    lines = text[:start].splitlines()
    kept = [
        line for line in lines if not line.startswith(("import arapfields", "import os", "from . import"))
    ]
    text = "\n".join([*kept, imports + "import typing_extensions", head]) + text[start:]
    return text


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        Path(sys.argv[1]).write_text(finished(generated(folder)))
