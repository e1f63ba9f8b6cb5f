# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's guide as HTML pages in the extension's zip, opened from Blender's context menus."""

import importlib.util
import io
import re
from pathlib import Path

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
