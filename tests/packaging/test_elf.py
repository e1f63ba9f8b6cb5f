# SPDX-License-Identifier: GPL-3.0-or-later
"""Editing shared libraries: what a library calls by a plain name is its own, whatever was loaded before."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "blender_scripts"))

from extension import elf

OTHERS = "int answer(void) { return 1; }"
OURS = "int answer(void) { return 2; } int ask(void) { return answer(); }"
ASK = """
import ctypes, sys
ctypes.CDLL(sys.argv[1], mode=ctypes.RTLD_GLOBAL)
ours = ctypes.CDLL(sys.argv[2])
print(ours.ask(), ours.answer())
"""


@pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler at hand")
def test_a_library_keeps_its_own_functions(tmp_path):
    paths = []
    for name, code in (("others", OTHERS), ("ours", OURS)):
        (tmp_path / f"{name}.c").write_text(code)
        paths.append(tmp_path / f"lib{name}.so")
        command = ["cc", "-shared", "-fPIC", "-O0", "-o", paths[-1], tmp_path / f"{name}.c"]
        subprocess.run(command, check=True)

    def asked():
        done = subprocess.run([sys.executable, "-c", ASK, *paths], capture_output=True, text=True, check=True)
        return done.stdout.split()

    assert asked() == ["1", "2"]  # the one that was loaded first
    assert {"ask", "answer"} <= set(elf.plain_functions(paths[1].read_bytes()))
    assert elf.keep_own_functions(paths[1]) >= 2
    assert asked() == ["2", "2"]


VERSIONS = "MADE_1.0 { global: answer; local: *; };"


@pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler at hand")
def test_a_copy_with_versions_of_its_own_is_the_one_that_is_found(tmp_path):
    """Two libraries with the same versioned symbol: the user's renamed version chooses the renamed copy."""

    def compiled(name, code, *further):
        (tmp_path / f"{name}.c").write_text(code)
        command = ["cc", "-shared", "-fPIC", "-o", tmp_path / f"lib{name}.so", tmp_path / f"{name}.c"]
        subprocess.run([*command, *further], check=True)
        return tmp_path / f"lib{name}.so"

    script = tmp_path / "versions"
    script.write_text(VERSIONS)
    versioned = f"-Wl,--version-script={script}"
    others = compiled("others", OTHERS, versioned)
    own = compiled("own", "int answer(void) { return 2; }", versioned)
    code = "int answer(void); int ask(void) { return answer(); }"
    user = compiled("user", code, own, f"-Wl,-rpath,{tmp_path}")

    def asked():
        script = ASK.replace("ours.ask(), ours.answer()", "ours.ask()")
        done = subprocess.run(
            [sys.executable, "-c", script, others, user], capture_output=True, text=True, check=True
        )
        return done.stdout.split()

    assert asked() == ["1"]
    assert elf.rename_versions(own, b"MADE_", b"OURS_") == 1
    assert elf.rename_versions(user, b"MADE_", b"OURS_") == 1
    assert asked() == ["2"]
