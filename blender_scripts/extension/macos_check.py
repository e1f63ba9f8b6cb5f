# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be said of a zip for macOS without a Mac; read from the zip itself.

python blender_scripts/extension/macos_check.py dist/arapfields-<version>-macos-arm64.zip

Every symbol that our files ask for is found: in what ships, in ziglang's list of libSystem's symbols, among
those of libc++ that torch's own library takes from it, in a list kept by hand (macos_symbols.txt; its lines
are counted apart, since nothing here proves them), or, for Python's, in the headers they were compiled with.
Every file is for ARM alone and for macOS 14, loads only what ships beside it and what belongs to the system,
and its signature's hashes are recomputed.
"""

import io
import re
import sys
import tempfile
import tomllib
import zipfile
from collections import Counter
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from extension import bindings, macho, macho_sign, macos_tools

SYSTEM_PLACES = ("/usr/lib/", "/System/Library/Frameworks/")
SYSTEM_LIBRARY = "/usr/lib/libSystem.B.dylib"
BESIDE = "@loader_path/"
PYTHON = re.compile(r"_(Py|_Py)\w+")
OURS = re.compile(r"libarapfields\.dylib|_native\..*\.so")


def native_files(path, folder):
    """Unpacks the libraries of the zip's wheels into `folder`; {name: image}, and the manifest."""
    found = {}
    with zipfile.ZipFile(path) as archive:
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        for name in manifest["wheels"]:
            with zipfile.ZipFile(io.BytesIO(archive.read(name.removeprefix("./")))) as wheel:
                for entry in wheel.namelist():
                    if entry.endswith((".dylib", ".so")):
                        target = folder / Path(entry).name
                        target.write_bytes(wheel.read(entry))
                        found[target.name] = target
    return found, manifest


def python_names(headers):
    """Words of the headers of one Python: its functions and objects are among them."""
    texts = (path.read_text(errors="replace") for path in Path(headers).rglob("*.h"))
    return {word for text in texts for word in re.findall(r"\b_?Py\w+", text)}


def check_file(path, names):
    """Pages of the file's signature; RuntimeError where it is for another processor or system, loads what is
    not shipped, searches elsewhere, or is not signed rightly."""
    image, name = macho.read(path), path.name
    if not macho.is_arm64(image):
        raise RuntimeError(f"{name} is for another processor than ARM's")
    if macho.minimum_system(image) > macos_tools.SYSTEM:
        raise RuntimeError(f"{name} needs macOS {macho.minimum_system(image)}")
    for loaded in macho.loaded(image):
        beside = loaded.startswith(BESIDE) and loaded.removeprefix(BESIDE) in names
        if not beside and not loaded.startswith(SYSTEM_PLACES):
            raise RuntimeError(f"{name} loads {loaded}, which does not ship")
    if macho.rpaths(image):
        raise RuntimeError(f"{name} searches {macho.rpaths(image)}")
    if macho.install_name(image) not in ("", BESIDE + name):
        raise RuntimeError(f"{name} calls itself {macho.install_name(image)}")
    return macho_sign.check_signature(path)


def sources(path, images, proven, python):
    """Counter of where the symbols are that the file asks for; RuntimeError for one that is nowhere."""
    known = {SYSTEM_LIBRARY: macos_tools.system_symbols(), macos_tools.LIBCXX: proven}
    places, missing = Counter(), []
    for symbol, owner in macho.undefined_symbols(images[path.name]):
        if owner is not None and owner.startswith(BESIDE):
            place = owner.removeprefix(BESIDE)
            found = macho.exports(images[place], symbol)
        elif symbol in macos_tools.ALSO_THERE:
            seen = macos_tools.ALSO_THERE[symbol][0]
            place, found = "libc++ as others ask" if seen else "libc++ by expectation alone", True
        elif owner in known:
            place, found = Path(owner).name, symbol in known[owner]
        elif owner is None:  # any library's: the first that has it, among those that ship, else the system's
            place, found = "C++'s shared ones", any(macho.exports(image, symbol) for image in images.values())
            found = found or symbol in proven
        else:
            place, found = "Python", bool(PYTHON.fullmatch(symbol)) and symbol[1:] in python
        places[place] += 1
        if not found:
            missing.append(f"{symbol} ({place})")
    if missing:
        raise RuntimeError(
            f"{path.name} asks for {len(missing)} symbols that nobody has: {', '.join(missing[:5])}"
        )
    return places


def system_needs(images):
    """{library of the system: number of symbols} that torch's libraries take, our own aside."""
    needs = Counter()
    for name, image in images.items():
        if not OURS.fullmatch(name):
            needs.update(owner for _, owner in macho.undefined_symbols(image) if owner and "/" in owner[:1])
    return needs


def module_python(name):
    found = re.match(r"_native\.cpython-(\d)(\d+)-", name)
    return (int(found[1]), int(found[2])) if found else None


def report(path, headers):
    """Lines that say what was verified of the zip, with figures; RuntimeError with what does not hold."""
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        files, manifest = native_files(path, Path(folder))
        images = {name: macho.read(file) for name, file in files.items()}
        if manifest["platforms"] != ["macos-arm64"] or "not yet run" not in manifest["tagline"]:
            raise RuntimeError("the manifest does not say that it is for macOS and was not yet run")
        torch = [file for name, file in files.items() if not OURS.fullmatch(name)]
        proven = macos_tools.proven_symbols(torch, macos_tools.LIBCXX) | macos_tools.shared_operators(torch)
        for name, file in sorted(files.items()):
            pages = check_file(file, files)
            said = f"{name}: arm64, macOS {'.'.join(map(str, macho.minimum_system(images[name])))}, "
            said += f"{pages} pages signed"
            if OURS.fullmatch(name):
                python = python_names(headers[module_python(name)]) if module_python(name) else set()
                places = sources(file, images, proven, python)
                found = ", ".join(f"{count} in {place}" for place, count in sorted(places.items()))
                said += f"; {sum(places.values())} symbols found: {found}"
            lines.append(said)
        needs = system_needs(images)
        lines.append(
            "torch needs of the system, unchecked: "
            + ", ".join(f"{Path(name).name} {count}" for name, count in sorted(needs.items()))
        )
    return [*lines, f"zip: {Path(path).stat().st_size / 1e6:.0f} MB", "not run: no Mac was at hand"]


if __name__ == "__main__":
    try:
        print("\n".join(report(Path(sys.argv[1]), bindings.find_headers())))
    except RuntimeError as error:
        sys.exit(f"macos_check: {error}")
