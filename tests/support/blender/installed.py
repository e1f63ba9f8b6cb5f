# SPDX-License-Identifier: GPL-3.0-or-later
"""Script for a separate Blender: installs the extension from a zip, uses, disables and removes it.

blender --background --python installed.py -- ZIP [--torch before|after] [--library LIBTORCH_CPU]
python installed.py ZIP …
"""

import argparse
import ctypes
import os
import sys
from importlib.machinery import PathFinder
from pathlib import Path

TESTS = Path(__file__).resolve().parents[2]
FOLDER = Path(os.environ["BLENDER_USER_RESOURCES"])
MODULE = "bl_ext.user_default.arapfields"


class FromTheExtension:
    """Import finder that finds arapfields only in the user folder, not in the environment."""

    @staticmethod
    def find_spec(name, path=None, target=None):
        if name == "arapfields":
            spec = PathFinder.find_spec(name, [p for p in sys.path if str(FOLDER) in p])
            if spec is None:
                raise ModuleNotFoundError("not in the extension", name=name)
            return spec
        return None


def arguments():
    given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    parser = argparse.ArgumentParser()
    parser.add_argument("zip")
    parser.add_argument("--torch", choices=("before", "after"))
    parser.add_argument("--library", help="another libtorch_cpu.so, instead of Python's torch")
    return parser.parse_args(given)


def other_torch(library):
    """Uses torch as another add-on would: trains with it, or loads only its C++ library."""
    if library:
        ctypes.CDLL(library)
        return
    import torch

    x = torch.randn(64, 8, requires_grad=True)
    model = torch.nn.Sequential(torch.nn.Linear(8, 32), torch.nn.Softplus(), torch.nn.Linear(32, 1))
    optimizer = torch.optim.Adam(model.parameters())
    for _ in range(5):
        loss = model(x).square().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert torch.isfinite(loss)


def install(path):
    import bpy

    done = bpy.ops.extensions.package_install_files(
        filepath=path, repo="user_default", enable_on_install=True
    )
    assert done == {"FINISHED"}, done
    assert MODULE in bpy.context.preferences.addons


def use():
    import bpy
    from bl_ext.user_default.arapfields.core.runtime import native
    from support.blender import scenes

    assert not native.problem(), native.problem()
    import arapfields

    assert str(FOLDER) in arapfields.__file__, arapfields.__file__
    bpy.ops.wm.read_homefile(use_empty=True)
    bar, _, moving = scenes.bar_with_handles()
    scenes.decorate(bar)
    kept = scenes.everything(bar)
    quick = bar.arapfields.fit
    quick.iterations, quick.width, quick.layers, quick.near_points = 100, 32, 2, 20000
    bpy.ops.arapfields.fit()
    moving.location.z += 0.3
    bpy.ops.arapfields.deform(output="WARP", **scenes.NEW)
    assert scenes.everything(bpy.data.objects["Bar_deformed"]) == kept
    assert scenes.world_points(bpy.data.objects["Bar_deformed"])[:, 2].max() > 0.4
    scenes.activate(bar)
    bpy.ops.arapfields.stylize(style="CUBE", **scenes.NEW)
    extract(bar, 32)


def extract(item, resolution):
    import bpy
    from support.blender import scenes

    scenes.activate(item)
    bpy.ops.arapfields.extract(resolution=resolution)
    assert len(bpy.data.objects[f"{item.name}_implicit"].data.polygons) > 100


def switch_off_and_remove():
    import bpy

    bpy.ops.preferences.addon_disable(module=MODULE)
    assert not hasattr(bpy.types.Object, "arapfields")
    bpy.ops.preferences.addon_enable(module=MODULE)
    assert hasattr(bpy.types.Object, "arapfields")
    names = [repo.module for repo in bpy.context.preferences.extensions.repos]
    bpy.ops.extensions.package_uninstall(repo_index=names.index("user_default"), pkg_id="arapfields")
    assert not hasattr(bpy.types.Object, "arapfields")
    assert MODULE not in bpy.context.preferences.addons


def main():
    options = arguments()
    sys.meta_path.insert(0, FromTheExtension)
    if options.torch == "before":
        other_torch(options.library)
    sys.path.insert(0, str(TESTS))
    import bpy
    import numpy

    install(options.zip)
    use()
    if options.torch:
        other_torch(options.library)
        extract(bpy.data.objects["Bar"], 24)
    switch_off_and_remove()
    print(f"USED {bpy.app.version_string}, Python {sys.version.split()[0]}, NumPy {numpy.__version__}")


def leave():
    """Ends a bpy 4.2, which would free update callbacks of add-ons after Python's end, and crash."""
    import bpy

    sys.stdout.flush()
    if not hasattr(bpy.app, "module") and not bpy.app.binary_path:
        os._exit(0)


if __name__ == "__main__":
    main()
    leave()
