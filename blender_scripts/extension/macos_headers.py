# SPDX-License-Identifier: GPL-3.0-or-later
"""Python's headers as a Mac with an Apple processor has them, from those of a Linux system.

The headers are the same everywhere but for pyconfig.h, the record of what CPython's configure found. This
writes a short one with what the public headers ask for: sizes as the compiler itself has them, checked by
it, and what python.org's builds for macOS switch on. A question that is not answered here is an error, not a
guess.
"""

import re
from pathlib import Path

SIZES = {  # by the compiler's own macros, or by types that are checked while compiling
    "SIZEOF_INT": "__SIZEOF_INT__",
    "SIZEOF_LONG": "__SIZEOF_LONG__",
    "SIZEOF_LONG_DOUBLE": "__SIZEOF_LONG_DOUBLE__",
    "SIZEOF_LONG_LONG": "__SIZEOF_LONG_LONG__",
    "SIZEOF_SIZE_T": "__SIZEOF_SIZE_T__",
    "SIZEOF_UINTPTR_T": "__SIZEOF_POINTER__",
    "SIZEOF_VOID_P": "__SIZEOF_POINTER__",
    "SIZEOF_WCHAR_T": "__SIZEOF_WCHAR_T__",
    "SIZEOF__BOOL": "1",
    "SIZEOF_PID_T": "4",
    "SIZEOF_PTHREAD_T": "8",
    "SIZEOF_TIME_T": "8",
    "ALIGNOF_MAX_ALIGN_T": "8",
}
CHECKED = {
    "SIZEOF_PID_T": "sizeof(pid_t)",
    "SIZEOF_PTHREAD_T": "sizeof(pthread_t)",
    "SIZEOF_TIME_T": "sizeof(time_t)",
    "SIZEOF__BOOL": "sizeof(bool)",
    "ALIGNOF_MAX_ALIGN_T": "alignof(max_align_t)",
}
PRESENT = {  # headers, functions and switches of a python.org build
    *("HAVE_CLOCK_GETTIME", "HAVE_FORK", "HAVE_PTHREAD_H", "HAVE_SSIZE_T", "HAVE_SYS_SELECT_H"),
    *("HAVE_SYS_STAT_H", "HAVE_SYS_TIME_H", "HAVE_SYS_TYPES_H", "HAVE_WCHAR_H"),
    *("WITH_DOC_STRINGS", "WITH_MIMALLOC", "WITH_PYMALLOC", "_Py_STACK_GROWS_DOWN"),
}
VALUES = {"PY_FORMAT_SIZE_T": '"z"'}
ABSENT = {"Py_ENABLE_SHARED", "WITH_DTRACE", "_XOPEN_SOURCE_EXTENDED"}
NOT_INCLUDED = {"pyconfig.h", "py_curses.h"}  # the latter is for curses' own modules


def linux_config(folder):
    """The text of the pyconfig.h of the headers in `folder`; Debian keeps it in a folder of its own."""
    beside = sorted(folder.parent.glob(f"*-linux-gnu/{folder.name}/pyconfig.h"))
    return (beside[0] if beside else folder / "pyconfig.h").read_text()


def asked(folder):
    """Names that the public headers in `folder` ask for while being preprocessed, and sizes that they use."""
    found = set()
    for path in folder.rglob("*.h"):
        if path.name in NOT_INCLUDED or "internal" in path.parts:
            continue
        text = path.read_text(errors="replace")
        for line in re.findall(r"^[ \t]*#[ \t]*(?:if|ifdef|ifndef|elif)\b((?:.*\\\n)*.*)", text, flags=re.M):
            found |= set(re.findall(r"\b[A-Za-z_]\w+", line))
        found |= set(re.findall(r"\b(?:SIZEOF|ALIGNOF)_\w+", text))
    return found


def macos_config(folder):
    """The text of pyconfig.h; RuntimeError where the headers ask for what is not known of macOS."""
    questions = asked(folder) & set(re.findall(r"^#define (\w+)", linux_config(folder), flags=re.M))
    answers = SIZES | dict.fromkeys(PRESENT, "1") | VALUES
    unknown = questions - set(answers) - ABSENT
    if unknown:
        raise RuntimeError(f"pyconfig.h of macOS is not known to have {', '.join(sorted(unknown))}")
    given = sorted(questions - ABSENT)
    lines = ["/* What macOS on ARM has of what these headers ask for; written by macos_headers.py. */"]
    lines += ["#ifndef Py_PYCONFIG_H", "#define Py_PYCONFIG_H", "#define _DARWIN_C_SOURCE 1"]
    lines += [f"#define {name} {answers[name]}" for name in given]
    used = ("pthread", "stdbool", "stddef", "sys/types", "time")
    lines += [f"#include <{name}.h>" for name in used]
    lines += [f'static_assert({CHECKED[name]} == {name}, "{name}");' for name in given if name in CHECKED]
    return "\n".join([*lines, "#endif", ""])


def macos_headers(folder, output):
    """Copies the headers in `folder` into `output`, with macOS's pyconfig.h; the copy's path. Files that are
    there with the same content stay, so that nothing is compiled anew for them."""
    folder = Path(folder)
    copy = Path(output) / folder.name
    files = {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*.h")}
    files[Path("pyconfig.h")] = macos_config(folder).encode()
    for path in set(copy.rglob("*.h")) - {copy / name for name in files}:
        path.unlink()
    for name, content in files.items():
        path = copy / name
        if not path.is_file() or path.read_bytes() != content:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
    return copy
