# SPDX-License-Identifier: GPL-3.0-or-later
"""Private copies of libtorch under names of our own, and our library made to use them."""

import re
import shutil
import subprocess
from pathlib import Path

from . import elf


def private_name(name):
    """libtorch_cpu.so → libarapfields-torch_cpu.so, libgomp.so.1 → libarapfields-gomp.so.1"""
    return re.sub(r"^lib", "libarapfields-", name)


def bundled_closure(library, folder):
    """Libraries of `folder` that `library` needs, directly or through one another; names in that order."""
    wanted, pending = [], [library]
    while pending:
        for name in elf.needed(pending.pop(0)):
            if (folder / name).exists() and name not in wanted:
                wanted.append(name)
                pending.append(folder / name)
    return wanted


def strip(path):
    subprocess.run(["strip", "--strip-unneeded", str(path)], check=True)


def make_private(path, renamed, soname=None):
    """Gives the library at `path` its own name, the `renamed` dependencies and the folder it lies in."""
    arguments = ["--set-rpath", "$ORIGIN"]
    if soname:
        arguments += ["--set-soname", soname]
    for old in elf.needed(path):
        if old in renamed:
            arguments += ["--replace-needed", old, renamed[old]]
    elf.patchelf(*arguments, path)
    elf.weaken_unique_symbols(path)
    elf.keep_own_functions(path)
    elf.rename_versions(path, b"OMP_", b"AMP_")  # our OpenMP, not the one that Blender may have loaded


def prepare_libraries(library, torch_libraries, output):
    """Copies our `library` and what it needs of libtorch into `output`, stripped and made private.

    A copy is kept while it is newer than its original and than the rules here. Returns the paths, ours first.
    """
    output.mkdir(parents=True, exist_ok=True)
    names = bundled_closure(library, torch_libraries)
    if not any("torch" in name for name in names):
        raise RuntimeError(
            f"{library} needs no library of {torch_libraries}; is it built against that torch?"
        )
    renamed = {name: private_name(name) for name in names}
    copies = [(library, output / library.name, None)]
    copies += [(torch_libraries / name, output / renamed[name], renamed[name]) for name in names]
    rules = max(Path(module).stat().st_mtime for module in (__file__, elf.__file__))
    for original, copy, soname in copies:
        if copy.exists() and copy.stat().st_mtime >= max(rules, original.stat().st_mtime):
            continue
        partial = copy.with_name(copy.name + ".partial")
        shutil.copyfile(original, partial)
        partial.chmod(0o755)
        strip(partial)
        make_private(partial, renamed, soname)
        partial.rename(copy)
    return [copy for _, copy, _ in copies]


def foreign_needs(paths, bundled):
    """What the libraries at `paths` need beyond the C and C++ runtime and the `bundled` names."""
    system = re.compile(r"^(ld-linux.*|lib(c|m|dl|rt|pthread|gcc_s|stdc\+\+)\.so\.\d+)$")
    needs = {name for path in paths for name in elf.needed(path)}
    return sorted(name for name in needs - set(bundled) if not system.match(name))


def missing_symbols(module, library):
    """Our symbols that the binding `module` asks for and `library` does not have."""

    def names(path, which):
        command = ["nm", "-D", which, "--format=posix", str(path)]
        listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        return {line.split()[0].split("@")[0] for line in listed.splitlines()}

    wanted = {name for name in names(module, "--undefined-only") if "10arapfields" in name}
    return sorted(wanted - names(library, "--defined-only"))


def glibc_floor(paths):
    """The newest GLIBC_x.y version that any of the libraries asks for, as (x, y)."""
    floor = (2, 0)
    for path in paths:
        listed = subprocess.run(["objdump", "-T", str(path)], capture_output=True, text=True, check=True)
        found = re.findall(r"\bGLIBC_(\d+)\.(\d+)", listed.stdout)
        floor = max([floor, *((int(major), int(minor)) for major, minor in found)])
    return floor


def library_folder(torch_folder):
    """The folder of libtorch's shared libraries in a torch wheel."""
    folder = Path(torch_folder) / "lib"
    if not (folder / "libtorch_cpu.so").exists():
        raise RuntimeError(f"no libtorch_cpu.so in {folder}")
    return folder
