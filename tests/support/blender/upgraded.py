# SPDX-License-Identifier: GPL-3.0-or-later
"""Script for a separate Blender: installs the extension over itself while it is enabled, and the next start.

python upgraded.py ZIP     installs it, uses it, installs it again, uses it, keeps the preferences
python upgraded.py used    the next start: the extension is still enabled; uses it
python upgraded.py gone    the next start after installed.py: the extension is removed
"""

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).resolve().parents[2])]

import bpy  # noqa: E402
import installed  # noqa: E402


def main(order):
    sys.meta_path.insert(0, installed.FromTheExtension)
    if order.endswith(".zip"):
        for _ in range(2):
            installed.install(order)
            installed.use()
        bpy.ops.wm.save_userpref()
    else:
        bpy.ops.wm.read_userpref()
        enabled = installed.MODULE in bpy.context.preferences.addons
        left = [path for path in installed.FOLDER.rglob("*") if "arapfields" in path.name]
        assert (enabled, bool(left)) == (order == "used", order == "used"), (enabled, left)
        if enabled:
            installed.use()
    print("UPGRADED", order)


if __name__ == "__main__":
    main(sys.argv[1])
    installed.leave()
