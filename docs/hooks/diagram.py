# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws docs/images/architecture.svg from the code's includes: python docs/hooks/diagram.py

tests/docs checks that the picture is up to date.
"""

import html
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PICTURE = ROOT / "docs" / "images" / "architecture.svg"
HOLDS = {
    "mesh": "triangles, samples by area",
    "distance": "exact signed distance",
    "neural": "network jets, neural SDF",
    "sampling": "points by random lines",
    "fields": "f, J, D and pull-back",
    "energies": "value and cotangents",
    "optimize": "L-BFGS, Muon, Adam",
    "solve": "deform, stylize, RadialSolver",
    "sharpen": "styles on a mesh",
    "wrap": "one surface onto another",
    "attach": "what a body carries",
    "curve": "curves of the plane",
    "skin": "bone weights from poses",
    "extraction": "marching cubes",
    "io": "files, whole or not",
}
UNDER_ALL = ("core", "options")
WIDTH, STEP, BOX, TOP = 1596, 112, 100, 310
INK, LINE = "#1f2937", "#94a3b8"


def pipeline():
    """The native folders in CMake's order, without those that all others include."""
    text = (ROOT / "native" / "CMakeLists.txt").read_text()
    listed = re.search(r"foreach\(folder ([^)]*)\)", text)[1].split()
    return [folder for folder in listed if folder not in UNDER_ALL and "/" not in folder]


def includes():
    """The pairs (from, to) of folders with an include between their files."""
    found = set()
    for folder in [*pipeline(), *UNDER_ALL]:
        for path in sorted((ROOT / "native" / folder).rglob("*.*")):
            targets = re.findall(r'^\s*#include\s+"(\w+)/', path.read_text(), re.M)
            found |= {(folder, target) for target in targets if target != folder}
    return found


def box(x, y, width, height, title, note="", fill="#f8fafc"):
    middle = x + width / 2
    parts = [
        f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="6" fill="{fill}" stroke="{LINE}"/>',
        f'<text x="{middle}" y="{y + 22}" text-anchor="middle" font-weight="600">{html.escape(title)}</text>',
    ]
    words, line, lines = note.split(), "", []
    for word in words:
        if len(line) + len(word) > width / 6.6:
            lines.append(line)
            line = ""
        line = f"{line} {word}".strip()
    for number, text in enumerate([*lines, line]):
        parts.append(
            f'<text x="{middle}" y="{y + 39 + 14 * number}" text-anchor="middle" font-size="11">'
            f"{html.escape(text)}</text>"
        )
    return parts


def arc(start, end):
    """An arc above the boxes, from the including to the included folder."""
    lift = 22 + 24 * abs(start - end) / STEP
    return (
        f'<path d="M{start} {TOP}C{start} {TOP - lift:.0f} {end} {TOP - lift:.0f} {end} {TOP - 3}" '
        f'fill="none" stroke="#64748b" stroke-width="1.8" marker-end="url(#tip)"/>'
    )


def down(x, y, length):
    return f'<path d="M{x} {y}v{length}" stroke="#64748b" stroke-width="1.5" marker-end="url(#tip)"/>'


def svg():
    folders, found = pipeline(), includes()
    left = {name: 20 + STEP * i for i, name in enumerate(folders)}
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {TOP + 175}" font-family="sans-serif" '
        f'font-size="13" fill="{INK}">',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
        'markerUnits="userSpaceOnUse" orient="auto"><path d="M0 0L8 4L0 8z" fill="#64748b"/></marker></defs>',
        f'<rect width="{WIDTH}" height="{TOP + 175}" fill="#ffffff"/>',
    ]
    full = WIDTH - 40
    parts += box(20, 14, 300, 52, "addon", "Blender: core (no bpy), a folder a feature", "#fff7ed")
    parts += box(350, 14, 300, 52, "python/arapfields", "public names, files, command line", "#fff7ed")
    parts += box(680, 14, 300, 52, "bindings", "one file a folder; no torch headers", "#fff7ed")
    for x in (320, 650):
        parts.append(f'<path d="M{x} 40h28" stroke="#64748b" stroke-width="1.5" marker-end="url(#tip)"/>')
    parts.append(down(830, 66, 26))
    parts.append(f'<path d="M20 94h{full}" stroke="{LINE}" stroke-dasharray="4 4"/>')
    parts.append(
        '<text x="20" y="110" font-size="11">libarapfields: an arrow points to what is included</text>'
    )
    for source, target in sorted(found):
        if target not in UNDER_ALL and source not in UNDER_ALL:
            shift = 6 if left[source] > left[target] else -6
            parts.append(arc(left[source] + BOX / 2 - shift, left[target] + BOX / 2 + shift))
    for name in folders:
        parts += box(left[name], TOP, BOX, 66, name, HOLDS.get(name, ""))
        if (name, "core") in found:
            parts.append(down(left[name] + BOX / 2, TOP + 66, 32))
    note = "types, errors, task, random numbers, frame, jets, threads, dense products; every option once"
    parts += box(20, TOP + 100, full - 12, 52, "core, options", note, "#ecfeff")
    return "\n".join([*parts, "</svg>", ""])


if __name__ == "__main__":
    PICTURE.write_text(svg())
    print(f"wrote {PICTURE.relative_to(ROOT)}")
