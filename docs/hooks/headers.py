# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists the public C++ headers with their comments and exported names, at `<!-- headers -->`."""

import re
from pathlib import Path

NATIVE = Path(__file__).resolve().parents[2] / "native"
MARK = "<!-- headers -->"
EXPORTED = re.compile(r"(?:class|struct) ARAPFIELDS_EXPORT (\w+)|^ARAPFIELDS_EXPORT [^;{(=]*?(\w+)\(", re.M)


def on_page_markdown(markdown, **_):
    return markdown.replace(MARK, listed()) if MARK in markdown else markdown


def listed():
    rows = []
    for path in sorted((NATIVE / "include" / "arapfields").glob("*.h")):
        text = path.read_text(encoding="utf-8")
        about = " ".join(re.findall(r"^// (?!SPDX)(.*)", text, re.M)).partition(": ")[0].rstrip(".")
        names = {}
        for name in re.findall(r'^#include "([\w/]+\.h)"', text, re.M):
            if (NATIVE / name).exists():  # without the options' headers, which are generated
                found = EXPORTED.findall((NATIVE / name).read_text(encoding="utf-8"))
                names |= dict.fromkeys(f"`{one or other}`" for one, other in found)
        rows.append(f"- `arapfields/{path.name}`: {about}{': ' if names else ''}{', '.join(names)}")
    return "\n".join(rows)
