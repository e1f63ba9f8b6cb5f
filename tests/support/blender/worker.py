# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender process that runs test functions on request, each in an empty file.

Reads lines of JSON, {"file", "function", "arguments"}, and answers each with one line: "", a traceback, or
why the test is skipped.
"""

import ctypes
import faulthandler
import functools
import importlib.util
import json
import os
import sys
import traceback
from pathlib import Path

import bpy
import pytest

SAMPLES = 500  # a twelfth of live mode's default: these tests do not check the quality of solves
SKIPPED = "skipped: "


@functools.cache
def load(path):
    spec = importlib.util.spec_from_file_location(Path(path).stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def run(order):
    import addon
    from addon.solver import frame_solver

    frame_solver.SAMPLES = SAMPLES
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)  # keeps preferences and other add-ons
    addon.register()
    try:
        arguments = order["arguments"]
        if "tmp_path" in arguments:
            arguments["tmp_path"] = Path(arguments["tmp_path"])
        getattr(load(order["file"]), order["function"])(**arguments)
        return ""
    except pytest.skip.Exception as skipped:
        return SKIPPED + str(skipped)
    except BaseException:
        return traceback.format_exc()
    finally:
        addon.unregister()


def main():
    faulthandler.enable()  # prints the stacks of all threads after a crash
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # Blender's output must not mix with the answers
    bpy.ops.wm.read_factory_settings(use_empty=True)
    # PyPI's bpy leaves out of the path what Blender itself has there, such as USD.
    own = Path(bpy.utils.resource_path("LOCAL")) / "python/lib"
    sys.path.extend(map(str, own.glob("python*/site-packages")))
    for line in sys.stdin:
        print(json.dumps(run(json.loads(line))), file=answers, flush=True)
    # At the end of the process threads of Blender's may deadlock, under Wine also in _exit.
    if os.name == "nt":
        ctypes.windll.kernel32.TerminateProcess(ctypes.c_void_p(-1), 0)
    os._exit(0)


if __name__ == "__main__":
    main()
