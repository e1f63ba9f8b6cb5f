# SPDX-License-Identifier: GPL-3.0-or-later
"""Generates code and JSON from the table of options: python generate.py FOLDER [--table options.toml]

Writes to FOLDER: options/*.h, options/options.cpp, options/bind_options.cpp, and options.json, the resolved
table for the command line and Blender. Unchanged files are not written.
"""

import argparse
import json
import sys
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import cpp
import table as options_table


def contents(path):
    """{file name: content} of all generated files."""
    resolved = options_table.resolved(path)
    made = cpp.files(resolved)
    made["options.json"] = json.dumps(resolved, indent=1, ensure_ascii=False) + "\n"
    return made


def write(folder, made):
    for name, content in made.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != content:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(content, encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--table", type=Path, default=options_table.TABLE)
    given = parser.parse_args()
    try:
        write(given.folder, contents(given.table))
    except (options_table.TableError, tomllib.TOMLDecodeError) as error:
        sys.exit(f"{given.table}: {error}")
