# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables and the plot of docs/performance.md, from build/bench.json: python -m tests.benchmarks.render"""

import html
import importlib
import json
import math
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "build" / "bench.json"
PAGE = ROOT / "docs" / "performance.md"
PLOT = ROOT / "docs" / "images" / "performance.svg"
BEGIN, END = "<!-- bench: begin -->", "<!-- bench: end -->"
HEADINGS = {"ours_s": "ours, s", "theirs_s": "theirs, s", "times_faster": "times faster"}


def table(rows):
    """A Markdown table with every column that some row has, in the order of their first use."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    lines = ["| " + " | ".join(HEADINGS.get(name, name.replace("_", " ")) for name in columns) + " |"]
    lines.append("|" + "|".join("---:" if is_number(rows, name) else "---" for name in columns) + "|")
    lines += ["| " + " | ".join(text(row.get(name, "")) for name in columns) + " |" for row in rows]
    return "\n".join(lines)


def is_number(rows, name):
    return all(isinstance(row.get(name, 0), int | float) for row in rows)


def text(value):
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value).replace("|", "\\|")


def title(module):
    """The first sentence of the benchmark module's docstring; its name where it cannot be imported."""
    try:
        doc = importlib.import_module(f"tests.benchmarks.{module}").__doc__ or module
    except ImportError:
        doc = module
    return " ".join(doc.split("\n\n")[0].split()).rstrip(".")


def bars(results):
    """(label, ratio) of every row that was paired with a competitor."""
    found = []
    for module, rows in results.items():
        for row in rows:
            if isinstance(row.get("times_faster"), int | float) and row["times_faster"] > 0:
                words = [str(v) for v in row.values() if isinstance(v, str)]
                numbers = [f"{k} {v:,}" for k, v in row.items() if isinstance(v, int)]
                found.append((", ".join([*(words or [module]), *numbers[:1]]), float(row["times_faster"])))
    return found


def plot(found, left=400, width=860, step=24):
    """A bar a row on a logarithmic scale: to the right of the line, ours is faster."""
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
        blocks += [f"![How many times faster than the competitor, row by row](images/{PLOT.name})", ""]
    for module, rows in results.items():
        blocks += [f"## {title(module)}", "", table(rows), ""]
    return "\n".join(blocks)


def main():
    if not RESULTS.exists():
        sys.exit(f"{RESULTS} is not there: run make bench first")
    results = json.loads(RESULTS.read_text())
    machine = results.pop("machine")
    results = {module: rows for module, rows in results.items() if rows}
    before, rest = PAGE.read_text().split(BEGIN)
    after = rest.split(END)[1]
    PAGE.write_text(f"{before}{BEGIN}\n{page(results, machine)}{END}{after}")
    if bars(results):
        PLOT.write_text(plot(bars(results)))
    print(f"wrote {PAGE.relative_to(ROOT)}" + (f" and {PLOT.relative_to(ROOT)}" if bars(results) else ""))


if __name__ == "__main__":
    main()
