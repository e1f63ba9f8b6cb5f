# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds the Blender extension: a zip with the add-on and its wheels for each platform.

python blender_scripts/build_extension.py linux-x64 windows-x64 --output dist
"""

import argparse
import importlib.util
import io
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "blender_scripts"), str(ROOT / "cmake/wheel")]

from platforms import PLATFORMS  # noqa: E402

# Blender's extension tool, run in a separate process by this environment's bpy.

CODE = """
import sys, bpy, addon_utils
from bl_pkg import bl_extension_cli
sys.exit(bl_extension_cli.cli_extension_handler(sys.argv[1:]))
"""


def extension_tool(*arguments):
    """Runs `blender --command extension …`; RuntimeError with its output if it fails."""
    command = [sys.executable, "-c", CODE, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        said = f"{done.stdout}{done.stderr}".strip()[-4000:]
        raise RuntimeError(f"Blender's extension {arguments[0]} fails:\n{said}")
    return done.stdout


# The user's guide as HTML pages in the extension's zip, opened from Blender's context menus.

FOLDER = "guide"  # in the extension; read by addon/blender/source_operator.py
PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title} · ARAP Fields</title>
<style>body {{ font: 16px/1.5 sans-serif; max-width: 50em; margin: 2em auto; padding: 0 1em }}
img {{ max-width: 100% }} table {{ border-collapse: collapse }}
td, th {{ border: 1px solid #ccc; padding: .3em .6em; text-align: left }}</style></head><body>
<p>{pages}</p>
{body}
</body></html>
"""
LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")


def option_tables(docs):
    """The documentation's hook that inserts tables of options."""
    spec = importlib.util.spec_from_file_location("guide_options", docs / "hooks" / "options.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def guide_files(docs):
    """{archive name: content} of all pages of docs/guide and their pictures.

    Links to files that are not shipped become plain text.
    """
    import markdown

    fill, pictures = option_tables(docs).on_page_markdown, {}
    sources = sorted((docs / "guide").glob("*.md"))
    names = {page.name for page in sources}

    def link(found):
        mark, text, target = found.groups()
        path, _, anchor = target.partition("#")
        if mark:
            picture = (docs / "guide" / path).resolve()
            name = f"{picture.stem}.webp"
            pictures[f"{FOLDER}/{name}"] = small(picture)
            return f"![{text}]({name})"
        if re.match(r"https?:", target):
            return found[0]
        if path and path not in names:
            return text
        place = path.replace(".md", ".html") + (f"#{anchor}" if anchor else "")
        return f"[{text}]({place})"

    contents = " · ".join(f'<a href="{page.stem}.html">{title_of(page)}</a>' for page in sources)
    pages = {}
    for page in sources:
        text = LINK.sub(link, fill(page.read_text(encoding="utf-8")))
        body = markdown.markdown(text, extensions=["tables", "toc", "sane_lists"])
        html = PAGE.format(title=title_of(page), pages=contents, body=body)
        pages[f"{FOLDER}/{page.stem}.html"] = html.encode()
    return pages | pictures


def small(picture):
    """The bytes of a picture as WebP, an eighth of a PNG's size."""
    from PIL import Image

    content = io.BytesIO()
    Image.open(picture).save(content, "WEBP", quality=80)
    return content.getvalue()


def title_of(page):
    return Path(page).read_text(encoding="utf-8").splitlines()[0].lstrip("# ")


# The extension's zip: manifest, add-on and wheels.

OPTIONS = "core/settings/options.json"  # read by addon/core/settings/parameters.py
RUN = ("linux-x64", "windows-x64")  # the manifests of the others say that they are untested
TIMESTAMP = (2020, 1, 1, 0, 0, 0)  # for reproducible archives


def entry(name, method=zipfile.ZIP_DEFLATED):
    info = zipfile.ZipInfo(name, TIMESTAMP)
    info.external_attr = 0o100644 << 16
    info.compress_type = method
    return info


def read_manifest(addon):
    return tomllib.loads((addon / "blender_manifest.toml").read_text())


def addon_files(addon):
    """{archive name: path} of all shipped files of the add-on except the manifest."""
    kept = [path for path in sorted(addon.rglob("*")) if path.is_file() and "__pycache__" not in path.parts]
    names = {str(path.relative_to(addon)): path for path in kept}
    names.pop("blender_manifest.toml")
    return names


def manifest_text(text, platform, wheels):
    """The manifest for one platform and its wheels."""
    text = re.sub(r"^platforms = .*$", f'platforms = ["{platform}"]', text, flags=re.M)
    if platform not in RUN:
        text = re.sub(r'^(tagline = ".*)"$', r'\1 (not yet run)"', text, flags=re.M)
    # Keys after a table belong to it: the wheels are inserted before the first table.
    head, table, tail = text.partition("\n[")
    lines = "".join(f'  "./wheels/{wheel.name}",\n' for wheel in wheels)
    return f"{head}\nwheels = [\n{lines}]\n{table}{tail}"


def write_extension(addon, wheels, licence, guide, path, platform):
    """Writes the extension's zip to `path`; `guide`: {archive name: content} of the user's guide.

    options.json is taken from the first wheel. Wheels are stored, as they are compressed.
    """
    manifest = manifest_text((addon / "blender_manifest.toml").read_text(), platform, wheels)
    tomllib.loads(manifest)
    with zipfile.ZipFile(wheels[0]) as content:
        options = content.read("arapfields/options.json")
    partial = path.with_suffix(".partial")
    with zipfile.ZipFile(partial, "w", compresslevel=9) as archive:
        archive.writestr(entry("blender_manifest.toml"), manifest)
        archive.writestr(entry("LICENSE"), licence)
        archive.writestr(entry(OPTIONS), options)
        for name, source in addon_files(addon).items():
            archive.writestr(entry(name), source.read_bytes())
        for name, content in guide.items():
            archive.writestr(entry(name), content)
        for wheel in wheels:
            archive.writestr(entry(f"wheels/{wheel.name}", zipfile.ZIP_STORED), wheel.read_bytes())
    partial.replace(path)


LIMIT = 10e6  # bytes
PARTS = {"blender_manifest.toml", "__init__.py", "LICENSE", OPTIONS, "guide/index.html"}


def check_zip(path, wheels):
    """RuntimeError if the zip is too large or incomplete, or its wheels differ from these files.

    Blender accepts a zip without native code.
    """
    with zipfile.ZipFile(path) as archive:
        names = set(archive.namelist())
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        listed = {name.removeprefix("./") for name in manifest.get("wheels", [])}
        wanted = {f"wheels/{wheel.name}" for wheel in wheels}
        if missing := (PARTS | listed | wanted) - names:
            raise RuntimeError(f"{path.name} lacks {', '.join(sorted(missing))}")
        if listed != wanted:
            raise RuntimeError(
                f"{path.name} has other wheels than its manifest: {', '.join(listed ^ wanted)}"
            )
        for wheel in wheels:
            if archive.read(f"wheels/{wheel.name}") != Path(wheel).read_bytes():
                raise RuntimeError(f"{path.name} has another {wheel.name}")
    if path.stat().st_size > LIMIT:
        raise RuntimeError(f"{path} has {path.stat().st_size / 1e6:.1f} MB; the limit is {LIMIT / 1e6:.0f}")


# The program.


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("platforms", nargs="+", choices=[*PLATFORMS, "all"], metavar="platform")
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="has the wheels, gets the zips")
    given = parser.parse_args()
    given.platforms = list(PLATFORMS) if "all" in given.platforms else given.platforms
    return given


def own_wheels(platform, folder, version):
    """The wheels for Blender's Pythons, built by build_wheels.py."""
    names = map(platform.wheel_tags, platform.extension_wheels)
    wheels = [folder / f"arapfields-{version}-{name}.whl" for name in names]
    missing = [wheel.name for wheel in wheels if not wheel.exists()]
    if missing:
        raise RuntimeError(f"{folder} lacks {', '.join(missing)} (make wheels PLATFORM={platform.name})")
    return wheels


def polib(folder):
    """The wheel of polib (reads translations), in the version of requirements.txt."""
    (pinned,) = [line for line in (ROOT / "requirements.txt").read_text().splitlines() if "polib==" in line]
    command = [sys.executable, "-m", "pip", "download", "-q", "--disable-pip-version-check", "--no-deps"]
    subprocess.run([*command, "--only-binary", ":all:", "--dest", folder, pinned], check=True)
    (wheel,) = folder.glob(f"{pinned.replace('==', '-')}-*-none-any.whl")
    return wheel


def build(platform, folder):
    addon = ROOT / "addon"
    version = read_manifest(addon)["version"]
    wheels = [*own_wheels(platform, folder, version), polib(ROOT / "build")]
    path = folder / f"arapfields-{version}-{platform.name}.zip"
    licence, pages = (ROOT / "LICENSE").read_text(), guide_files(ROOT / "docs")
    write_extension(addon, wheels, licence, pages, path, platform.name)
    check_zip(path, wheels)
    extension_tool("validate", path)
    print(f"{path} ({path.stat().st_size / 1e6:.1f} MB)")


if __name__ == "__main__":
    given = arguments()
    try:
        for name in given.platforms:
            build(PLATFORMS[name], given.output.resolve())
    except (RuntimeError, subprocess.CalledProcessError) as error:
        sys.exit(f"build_extension: {error}")
