# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender of its own that runs test functions sent to it, each in an empty file.

Reads lines of JSON, {"file", "function", "arguments"}, and answers each with one line: "" or a traceback.
"""

import importlib.util
import json
import sys
import traceback
from pathlib import Path

import bpy


def load(path, loaded={}):  # noqa: B006: one module a file
    if path not in loaded:
        spec = importlib.util.spec_from_file_location(Path(path).stem, path)
        loaded[path] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(loaded[path])
    return loaded[path]


def run(order):
    import addon

    bpy.ops.wm.read_factory_settings(use_empty=True)
    addon.register()
    try:
        getattr(load(order["file"]), order["function"]).inside(**order["arguments"])
        return ""
    except BaseException:
        return traceback.format_exc()
    finally:
        addon.unregister()


def main():
    answers = sys.stdout
    sys.stdout = sys.stderr
    for line in sys.stdin:
        print(json.dumps(run(json.loads(line))), file=answers, flush=True)


if __name__ == "__main__":
    main()
