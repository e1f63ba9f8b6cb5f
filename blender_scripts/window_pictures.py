# SPDX-License-Identifier: GPL-3.0-or-later
"""The guide's pictures of Blender's window, cropped from screenshots of tests/gui/window.py.

    python blender_scripts/window_pictures.py OUTPUT_OF_PANEL [OUTPUT_OF_JOBS_AND_LIVE] [--to docs/images]

The folders are those of `window.py -- FOLDER panel` and `window.py -- FOLDER jobs live`, in a window of
1600 × 1000. A section's picture ends at the next section's header, found by comparison with the closed panel.
"""

import argparse
from pathlib import Path

import numpy as np
from gallery import STORED
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
# Positions in the sidebar, in pixels: tests/gui/panel.py clicks the same rows.
STEP, INNER = 28.4, 26.0  # distance of closed sections, and of those in Advanced
LEFT, WORDS = slice(0, 258), slice(8, 120)  # columns of a section, and of its header's text
HEADER = 22  # height of compared strips
BEGINNING = 124  # of the first section, below the tasks
ADVANCED, STATUS = 3, 72  # row of Advanced, before that of the status; height of this with one line
SHOWN = (1280, 800)
TOP = (("handles", "panel", 0), ("deform", "panel", 1), ("stylize", "panel-style", 0))  # picture, row
WITHIN = (("surface", 0), ("result", 3))
WINDOW = {name: name for name in ("handles", "running", "cancelled")} | {
    "live": "dragged"
}  # blender-NAME.webp
MENU = (940, 206, 1284, 450)  # the menu of styles with its section's header


def pixels(path):
    return np.asarray(Image.open(path).convert("RGB"), dtype=np.int16)


def found(strip, picture):
    """The row of a picture at which a strip is found, by its text."""
    rows = range(picture.shape[0] - len(strip))
    off = [np.abs(picture[row : row + len(strip), WORDS] - strip[:, WORDS]).mean() for row in rows]
    row = int(np.argmin(off))
    if off[row] > 6:
        raise ValueError(f"no such header: the nearest is off by {off[row]:.1f} of 255")
    return row


def next_header(closed, row, step, beginning):
    """The strip of the next header below a row of the closed panel."""
    top = round(beginning + step * (row + 1)) + 2
    return closed[top : top + HEADER]


def section(path, row, closed, step, beginning):
    """The picture of one section, from its header to the next one's."""
    whole = pixels(path)
    end = found(next_header(closed, row, step, beginning), whole) - 2
    return whole[round(beginning + step * row) : end, LEFT]


def save(picture, path):
    Image.fromarray(np.asarray(picture, dtype=np.uint8)).save(path, **STORED)
    print(path)


def of_panel(folder, target):
    closed, advanced = pixels(folder / "panel-closed.png"), pixels(folder / "panel-advanced.png")
    for name, task, row in TOP:
        shut = pixels(folder / f"{task}-closed.png")
        made = section(folder / f"{task}-{name}.png", row, shut, STEP, BEGINNING)
        save(made, target / f"panel-{name}.webp")
    header = next_header(closed, ADVANCED - 1, STEP, BEGINNING)
    first = found(header, advanced) - 2 + STEP  # within Advanced
    for name, row in WITHIN:
        made = section(folder / f"panel-{name}.png", row, advanced, INNER, first)
        save(made, target / f"panel-{name}.webp")
    save(Image.open(folder / "panel-style-styles.png").convert("RGB").crop(MENU), target / "style-menu.webp")
    top = round(BEGINNING + STEP * (ADVANCED + 1))
    save(pixels(folder / "panel-status.png")[top : top + STATUS, LEFT], target / "panel-status.webp")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("panel", type=Path, help="the folder of window.py's part `panel`")
    parser.add_argument("jobs", type=Path, nargs="?", help="that of its parts `jobs` and `live`")
    parser.add_argument("--to", type=Path, default=ROOT / "docs/images")
    options = parser.parse_args()
    of_panel(options.panel, options.to)
    for name, taken in WINDOW.items():
        folder = options.panel if name == "handles" else options.jobs
        if folder is None:
            continue
        shown = Image.open(folder / f"{taken}.png").convert("RGB")
        save(shown.resize(SHOWN, Image.Resampling.LANCZOS), options.to / f"blender-{name}.webp")


if __name__ == "__main__":
    main()
