# SPDX-License-Identifier: GPL-3.0-or-later
"""Script for a separate Blender: adds an extension repository by its URL, installs from it, removes both.

python repository.py file:///…/index.json
"""

import sys


def main(address):
    import bpy

    bpy.context.preferences.system.use_online_access = True  # required even for file://
    bpy.ops.preferences.extension_repo_add(name="Ours", type="REMOTE", remote_url=address)
    repos = bpy.context.preferences.extensions.repos
    where, module = {"repo_index": len(repos) - 1}, f"bl_ext.{repos[-1].module}.arapfields"
    bpy.ops.extensions.repo_sync(**where)
    done = bpy.ops.extensions.package_install(pkg_id="arapfields", enable_on_install=True, **where)
    assert done == {"FINISHED"} and module in bpy.context.preferences.addons, done
    assert hasattr(bpy.types.Object, "arapfields")
    bpy.ops.extensions.package_uninstall(pkg_id="arapfields", **where)
    assert module not in bpy.context.preferences.addons
    print(f"SERVED Blender {bpy.app.version_string}")


if __name__ == "__main__":
    main(sys.argv[-1])
    sys.stdout.flush()
    import os

    os._exit(0)  # bpy 4.2 crashes at its end: see installed.py
