# SPDX-License-Identifier: GPL-3.0-or-later
"""Inserts measured figures into the pages: python docs/hooks/measured.py

In a page, <!-- NAME -->…<!-- end --> contains the text of the function NAME below (tested) from
docs/gallery/manifest.json, written by `make gallery`, or tables of docs/performance.md, by `make bench`.
"""

import json
import re
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1]
PAGES = [DOCS / "paper-figures.md", DOCS / "gallery.md", DOCS / "index.md", DOCS.parent / "README.md"]
MARKED = re.compile(r"(<!-- (\w+) -->).*?(<!-- end -->)", re.S)


def span(rows, key, digits):
    """'minimum to maximum' of a figure over the rows."""
    values = [row[key] for row in rows.values()]
    return f"{min(values):.{digits}f} to {max(values):.{digits}f}"


def listed(rows, key, form):
    return ", ".join(format(row[key], form) for row in rows.values())


def hero(m):
    moved = m["deformed"]
    return (
        f"mean handle error {moved['handle_error_mean']:.3f}, stretch {moved['stretch']:.3f}, smallest det J "
        f"{moved['min_determinant']:.2f}; mean preference {m['cube']['preference']:.2f} (cube) and "
        f"{m['octahedron']['preference']:.2f} (octahedron)"
    )


def bending(m):
    return f"mean bend {listed(m, 'bend', '.3g')}; mean stretch {listed(m, 'stretch', '.3f')}"


def deformations(m):
    worst = max(row["flipped_share"] for row in m.values())
    folded = "nothing folded" if worst == 0 else f"at most {100 * worst:.2f} % of the samples folded"
    return (
        f"mean handle error {span(m, 'handle_error_mean', 3)}, smallest det J "
        f"{min(row['min_determinant'] for row in m.values()):.2f}, {folded}"
    )


def exact(m):
    soft, hard = m["soft"], m["exact"]
    return (
        f"largest distance from the target {soft['largest_distance']:.2g} with soft and "
        f"{hard['largest_distance']:.0e} with exact handles, "
        f"energy {soft['energy']:.3f} and {hard['energy']:.3f}"
    )


def inverse(m):
    def of(name):
        row = m[name]
        return (
            f"{row['cells_apart_mean']:.3f}, {row['cells_apart_95_percent']:.3f} and "
            f"{row['cells_apart_largest']:.2f}"
        )

    return f"by Newton's method {of('newton')}; by a trained inverse {of('trained')}"


def inverted(m):
    points, failed = (m["newton"][key] + m["trained"][key] for key in ("points_inverted", "failures"))
    return f"{failed} of {points:,}"


def styles(m):
    worst = max(row["flipped_share"] for row in m.values())
    return (
        f"mean preference {span(m, 'preference_rest', 2)} at rest, {span(m, 'preference', 2)} stylized; "
        f"at most {100 * worst:.1f} % of the samples folded"
    )


def sheet(m):
    standing = [row for name, row in m.items() if not name.startswith("suzanne")]  # without feet
    fine = [row for name, row in m.items() if name.endswith(("dodecahedron", "icosahedron"))]
    lean, apart = (max(row[key] for row in standing) for key in ("tilt", "unevenness"))
    grown = min(row["share"] / row["share_rest"] for row in fine)
    worst = max(row["flipped_share"] for row in m.values())
    return (
        f"no figure leans by more than {lean:.1f}°, and no two feet come apart by more than "
        f"{100 * apart:.1f} % of the height. With twelve and twenty faces the area along the style grows "
        f"to {grown:.1f} times its share at rest, or more. At most {100 * worst:.2f} % of the samples folded"
    )


def cubes(m):
    rows = [(name, m[f"{name}, cube"]) for name in ("dog", "suzanne", "octopus")]
    told = [f"{row['preference_rest']:.2f} to {row['preference']:.2f} ({name.title()})" for name, row in rows]
    return "from " + ", ".join(told).replace("(Dog)", "(dog)").replace("(Octopus)", "(octopus)")


def live(m):
    return (
        f"{m['solves']} solves, median {m['median_solve_ms']:.0f} ms, after {m['set_up_s']:.2f} s of set-up"
    )


def median(m):
    return f"{m['median_solve_ms']:.0f} ms"


def table_rows(start):
    """Cells of rows of docs/performance.md whose first cell, or the last one above, begins with `start`."""
    found, first = [], ""
    for line in (DOCS / "performance.md").read_text().splitlines():
        cells = [cell.strip() for cell in line.split("|")[1:-1]] or [""]
        first = cells[0] or (first if line else "")
        found += [cells] if first.startswith(start) else []
    return found


def faster():
    (row,) = table_rows("N = 1000")
    return f"{float(row[-1]):.3g} times faster a step"


def fingers():
    """Motion of the neighbours of a bent finger, by field."""
    shares = [float(row[i]) for row in table_rows("middle forward 20 degrees") for i in (4, 6)]
    return f"{min(shares):.1f} to {max(shares):.1f} %"


def beside(start, further=""):
    """A sentence for this library and one for implicit-arap, from docs/peers.json by the problem's start."""
    rows = json.loads((DOCS / "peers.json").read_text())["rows"]
    sentences = []
    for by, shown in (("ours, default", "Ours"), ("implicit-arap", "implicit-arap")):
        (row,) = [row for row in rows if row.get("by") == by and row["what"].startswith(start)]
        if "mesh_energy" not in row:
            sentences.append(f"{shown}: {row['said']}")
            continue
        others = f", other fingertips {row['others_percent']:.1f} % of the length" if further else ""
        sentences.append(
            f"{shown}: energy {row['mesh_energy']:.3f}, handle error {row['handle_error_percent']:.2g} % of "
            f"the size{others}, volume {row['volume_ratio']:.2f}, {row['folded_percent']:.2g} % folded, "
            f"{row['cpu_s']:.3g} processor seconds"
        )
    return ". ".join(sentences)


def figure6():
    return beside("hand", further="fingers")


def figure7():
    return beside("bunny")


FIGURE = {
    "median": "live",
    "inverted": "inverse",
    "cubes": "styles",
    "sheet": "style_sheet",
}  # {text: figure}, if the names differ
TEXTS = [hero, bending, deformations, exact, inverse, inverted, styles, cubes, sheet, live, median]
OTHERS = [faster, fingers, figure6, figure7]  # from other files than the manifest


def refreshed(text):
    """The page with current figures."""
    manifest = json.loads((DOCS / "gallery" / "manifest.json").read_text())
    told = {f.__name__: f(manifest[FIGURE.get(f.__name__, f.__name__)]["measured"]) for f in TEXTS}
    told |= {f.__name__: f() for f in OTHERS}
    return MARKED.sub(lambda found: found[1] + told[found[2]] + found[3], text)


if __name__ == "__main__":
    for page in PAGES:
        page.write_text(refreshed(page.read_text()))
