# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables and the plot of docs/performance.md, from build/bench.json: python -m tests.benchmarks.render

Where that has the peers, docs/peers.json and the tables of docs/peers.md too.
"""

import ast
import html
import json
import math
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "build" / "bench.json"
PAGE = ROOT / "docs" / "performance.md"
PLOT = ROOT / "docs" / "images" / "performance.svg"
PEERS = ROOT / "docs" / "peers.md"
BEGIN, END = "<!-- bench: begin -->", "<!-- bench: end -->"
SECTIONS = {  # {module: title}; the module's first sentence is the subtitle
    "defaults": "From the press to the result",
    "exact": "Exact handles",
    "deform": "Deformation",
    "stylize": "Stylization",
    "live": "Live",
    "live_compare": "Live: against ARAP of a mesh, by size, and fingers",
    "sizes": "Cost against size",
    "sampling": "Uniform samples",
    "distance": "Signed distances",
    "extraction": "Extraction",
    "fit": "Fits",
    "backends": "Backends",
}
HEADINGS = {
    "reference_energy": "reference's energy",
    "first_s": "first result, s",
    "first_processor_s": "first result, processor s",
    "first_energy_ratio": "first result's energy over the reference's",
    "last_s": "last result, s",
    "last_processor_s": "last result, processor s",
    "last_energy_ratio": "last result's energy over the reference's",
    "handle_error_percent": "handle error, % of the size",
    "ours": "ours, thousand points a second",
    "competitor": "libigl, thousand points a second",
    "ours_s": "ours, s",
    "theirs_s": "theirs, s",
    "of_products": "time over the bare products'",
    "peak_MiB": "peak, MiB",
    "flipped": "folded",
    "flipped_share": "folded",
    "setup_s": "set-up, s",
    "setup_cpu_s": "set-up, processor s",
    "cpu_s": "processor s",
    "solves_per_s": "solves a second",
    "rest_to_70_s": "rest to 70°, s",
    "of_neural": "energy over the network's",
    "of_its_time": "time over the network's",
    "tracked_ms": "tracked points, ms",
    "anew_ms": "points anew, ms",
    "mesh_energy": "energy of the mesh",
    "volume_ratio": "volume",
    "handle_added_cpu_s": "handle added, processor s",
    "step_cpu_ms": "step, processor ms",
    "uniformity": "non-uniformity (1 is ideal)",
    "by": "",
    "folded_percent": "folded, %",
    "mean_angle": "mean angle to the style, degrees",
    "their_cpu_s": "theirs, processor s",
    "their_mesh_energy": "theirs, energy of the mesh",
    "their_mean_angle": "theirs, mean angle to the style, degrees",
    "angle_at_their_energy": "angle at their energy",
    "within_10_percent": "area within 10°, %",
    "others_percent": "other fingertips, % of the length",
}
# Columns that repeat another one, check the run, or describe the machine.
HIDDEN = {"ratio", "unit", "same_side", "same_number", "products_GFLOPs", "at_175_s", "energy_12_steps"}
PLOTTED = {"jets"}  # sections that appear only in the plot


def groups(rows):
    """Consecutive rows with similar columns: the keys of one include those of the other."""
    found = []
    for row in rows:
        if found and (row.keys() <= found[-1][0].keys() or row.keys() >= found[-1][0].keys()):
            found[-1].append(row)
        else:
            found.append([row])
    return found


def shown(name, columns):
    """Whether a column is shown: processor time is not shown beside the same wall time."""
    if name in ("ours_s", "theirs_s") and "competitor" in columns:
        return False  # the same as points per second
    twin = {"per_cpu_s": "solves_per_s"}.get(name, name.replace("_per_cpu_s", "").replace("_cpu", ""))
    return name not in HIDDEN and (twin == name or twin not in columns)


def table(rows):
    """A Markdown table with the columns of its rows, in the order of their first use."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    columns = [name for name in columns if shown(name, columns)]
    header = [HEADINGS.get(name, name.replace("_", " ")) for name in columns]
    lines = "|" + "|".join("---:" if is_number(rows, name) else "---" for name in columns) + "|"
    cells = [[text(row.get(name, "")) for name in columns] for row in rows]
    return drawn(header, lines, cells)


def drawn(header, lines, cells):
    """A Markdown table of cells; text that the first column repeats appears once, as heading or in a row."""
    first = [row[0] for row in cells]
    parts = [first[0][: part.end()] for part in re.finditer(": |, ", first[0])] if len(set(first)) > 1 else []
    shared = max((part for part in parts if all(one.startswith(part) for one in first)), key=len, default="")
    header = [shared.rstrip(" :,") or header[0], *header[1:]]
    cells = [
        ["" if row and value == first[row - 1] else value.removeprefix(shared), *cells[row][1:]]
        for row, value in enumerate(first)
    ]
    return "\n".join(
        ["| " + " | ".join(header) + " |", lines, *("| " + " | ".join(row) + " |" for row in cells)]
    )


def is_number(rows, name):
    return all(isinstance(row.get(name, 0), int | float) for row in rows)


def text(value):
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value).replace("|", "\\|")


def title(module):
    """The first sentence of the benchmark module's docstring, without the section's title."""
    source = (Path(__file__).parent / f"{module}.py").read_text()
    sentence = " ".join(ast.get_docstring(ast.parse(source)).split("\n\n")[0].split()).rstrip(".")
    sentence = sentence.removeprefix(f"{SECTIONS.get(module)}: ")
    return sentence[0].upper() + sentence[1:]


LABELS = {  # labels of the plot, by default the row's text
    "jets": "sweep of {points:,} points, {columns} columns, to bare products",
    "sampling": "20,000 samples of the {case}",
    "distance": "{name}",
    "extraction": "marching cubes, {case} points a side",
    "fit": "fit of a cow to a mean error of {target}",
}


def bars(results):
    """[(label, ratio)] of the rows with a competitor."""
    found = []
    for module, rows in results.items():
        for row in rows:
            if isinstance(row.get("times_faster"), int | float) and row["times_faster"] > 0:
                found.append((LABELS.get(module, "{what}").format(**row), float(row["times_faster"])))
    return found


def plot(found, left=400, width=860, step=24):
    """An SVG with a bar per row on a logarithmic scale; to the right of the line, this library is faster."""
    most = max(2.0, *(ratio for _, ratio in found)) * 1.25
    least = min(0.5, *(ratio for _, ratio in found)) / 1.1

    def x(ratio):
        return left + (width - left - 60) * math.log(ratio / least) / math.log(most / least)

    height = step * len(found) + 50
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" '
        f'font-size="12"><rect width="{width}" height="{height}" fill="#fff"/>'
    ]
    for tick in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500):
        if least <= tick <= most:
            stroke = "#444" if tick == 1 else "#ddd"
            parts.append(f'<path d="M{x(tick):.1f} 14V{height - 26}" stroke="{stroke}"/>')
            parts.append(f'<text x="{x(tick):.1f}" y="{height - 10}" text-anchor="middle">{tick:g}×</text>')
    for row, (label, ratio) in enumerate(found):
        y, ends = 22 + step * row, sorted((x(1), x(ratio)))
        colour = "#c2410c" if ratio >= 1 else "#64748b"
        short = label if len(label) <= 58 else label[:57] + "…"
        parts.append(f'<text x="{left - 12}" y="{y + 11}" text-anchor="end">{html.escape(short)}</text>')
        parts.append(
            f'<rect x="{ends[0]:.1f}" y="{y}" width="{ends[1] - ends[0]:.1f}" height="14" fill="{colour}"/>'
        )
        parts.append(f'<text x="{max(ends) + 6:.1f}" y="{y + 11}">{ratio:.3g}</text>')
    return "\n".join([*parts, "</svg>", ""])


def page(results, machine):
    """The part of the page between the markers."""
    named = ", ".join(f"{key} {value}" for key, value in machine.items())
    blocks = [f"Measured on: {named}.", ""]
    if bars(results):
        blocks += [
            f"![How many times faster than the competitor, row by row](images/{PLOT.name})",
            "",
            "*Times faster than what each section compares with, on a logarithmic scale; grey is slower.*",
            "",
        ]
    for module, rows in results.items():
        if module in PLOTTED:
            continue
        blocks += [f"## {SECTIONS.get(module, module)}", "", f"{title(module)}.", ""]
        for alike in groups(rows):
            blocks += [table(alike), ""]
    return "\n".join(blocks)


def peers_row(row):
    """The shown cells of a row, with the settings beside the method."""
    said = {"by": f"{row['by']} ({row['said']})"} if row.get("said") else {}
    return {key: value for key, value in (row | said).items() if key not in ("what", "vertices", "said")}


def peers_page(text, kept):
    """The page with the tables of docs/peers.json between its markers."""
    named = ", ".join(f"{key} {value}" for key, value in kept["machine"].items())
    codes = [f"`{row['code']}` at commit `{row['commit']}`" for row in kept["rows"] if "code" in row]
    blocks = [f"Measured on: {named}. {', '.join(codes)}.", ""]
    rows, kinds = [row for row in kept["rows"] if "code" not in row], {}
    for row in rows:
        kinds.setdefault(row.get("what", "Meshes that not all take"), []).append(row)
    for kind, alike in kinds.items():
        size = f", {alike[0]['vertices']:,} vertices" if "vertices" in alike[0] else ""
        blocks += [f"### {kind[0].upper()}{kind[1:]}{size}", "", table([peers_row(row) for row in alike]), ""]
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n" + "\n".join(blocks) + END + rest.split(END)[1]


def main():
    if not RESULTS.exists():
        sys.exit(f"{RESULTS} is not there: run make bench first")
    results = json.loads(RESULTS.read_text())
    machine = results.pop("machine")
    peers = results.pop("peers", None)
    if peers:
        kept = {"machine": machine, "rows": peers}
        PEERS.with_suffix(".json").write_text(json.dumps(kept, indent=1) + "\n")
        PEERS.write_text(peers_page(PEERS.read_text(), kept))
    if not (results := {module: rows for module, rows in results.items() if rows}):
        return
    before, rest = PAGE.read_text().split(BEGIN)
    after = rest.split(END)[1]
    PAGE.write_text(f"{before}{BEGIN}\n{page(results, machine)}{END}{after}")
    if bars(results):
        PLOT.write_text(plot(bars(results)))
    print(f"wrote {PAGE.relative_to(ROOT)}" + (f" and {PLOT.relative_to(ROOT)}" if bars(results) else ""))


if __name__ == "__main__":
    main()
