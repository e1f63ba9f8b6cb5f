# SPDX-License-Identifier: GPL-3.0-or-later
"""Pages and messages are plain English: sentences of at most eighteen words on average, and no archaic turns.

    python tests/docs/test_language.py    prints words, sentences and the average of each page

A sentence ends at a full stop, a question or an exclamation mark before a space, or where its paragraph or
list item ends; colons and semicolons end none. Not counted are headings, blocks of code, tables (their cells
are no sentences), pictures, displayed formulas and comments. A piece of inline code counts as one word;
formulas and a link's text count by their words, a link's target and what has no letter or digit not at all.
"""

import ast
import re
import tomllib

import pages
import pytest

MOST_ON_AVERAGE = 18  # words a sentence, on each page and over all
LONGEST = 40  # words of any sentence: a longer one is two
ITEM = re.compile(r"\s*(?:[-*+]|\d+\.|\[\^\w+\]:)\s+")
ARCHAIC = re.compile(
    r"\bshall\b|\bheed(?:s|ed)?\b|\bamid\b|\bupon\b|\bthereof\b|\bwhence\b|\bhither|\blest\b|\bfor want of\b"
    r"|\bwho comes late\b|\bwhat is asked of\b|\b(?:is|are|was) told\b|\bof whom\b|\bfor whom\b|\bas ever\b"
    r"|\bmet with\b|\bstands? aside\b",
    re.I,
)


def paragraphs(text):
    """The running text of a page, one string for each paragraph and list item."""
    text = re.sub(r"<!--.*?-->", "", pages.FENCE.sub("\n\n", text), flags=re.S)
    text = re.sub(r"^ +```.*?^ +```", "\n\n", text, flags=re.S | re.M)  # a block within a list
    text = re.sub(r"\$\$.*?\$\$", "\n\n", text, flags=re.S)
    text = re.sub(r"\[?!\[[^\]]*\]\([^)]*\)(?:\{[^}]*\})?(?:\]\([^)]*\))?", "", text)
    text = re.sub(r"</?\w[^>\n]*>|\A---\n.*?^---\n", "", text, flags=re.S | re.M)
    text = re.sub(r"\[\^\w+\](?!:)", "", re.sub(r"`[^`\n]+`", "code", text))
    text = re.sub(r"\]\([^)]*\)", "]", text)
    found = [""]
    for line in text.splitlines():
        if not line.strip() or line.startswith(("#", "|")):
            found.append("")
        elif ITEM.match(line):
            found.append(ITEM.sub("", line, count=1))
        else:
            found[-1] += " " + line.strip()
    return [paragraph for paragraph in found if paragraph.strip()]


def sentences(text):
    """The numbers of words of a page's sentences, each with its text."""
    found = []
    for paragraph in paragraphs(text):
        for sentence in re.split(r"(?<=[.!?])[*_)”\"]*\s+(?=\S)", paragraph):
            count = sum(bool(re.search(r"\w", word)) for word in sentence.split())
            found += [(count, sentence.strip())] if count else []
    return found


def average(counted):
    return sum(count for count, _ in counted) / max(1, len(counted))


@pytest.mark.parametrize("page", pages.PAGES, ids=pages.name)
def test_sentences_are_short(page):
    counted = sentences(page.read_text())
    assert average(counted) <= MOST_ON_AVERAGE
    assert not [sentence for count, sentence in counted if count > LONGEST]


def test_sentences_are_short_over_all_pages():
    assert average([row for page in pages.PAGES for row in sentences(page.read_text())]) <= MOST_ON_AVERAGE


README_WORDS, ALL_WORDS = 400, 32_617  # as wc -w counts; those of README and docs


def test_readme_and_docs_are_short():
    words = {page: len(page.read_text().split()) for page in pages.PAGES if page.name != "CHANGELOG.md"}
    assert words[pages.ROOT / "README.md"] <= README_WORDS
    assert sum(words.values()) <= ALL_WORDS


def test_what_counts_as_a_sentence():
    def counts(text):
        return [count for count, _ in sentences(text)]

    assert counts("# A heading\n\nOne two 3.5 four. Five six?\nSeven") == [4, 2, 1]
    assert counts("- one two\n- three\n  four: five; six\n\n| a | b |\n|---|---|\n| c | d |") == [2, 4]
    assert counts("```sh\nmake it\n```\nSee `a b` and [the page](page.md#x), *then stop.* Go on.") == [7, 2]
    assert counts(
        "![a picture](x.png)\n\n$$ a = b $$\n\n<!-- mark -->3 s<!-- end --> it took – no more."
    ) == [6]


@pytest.mark.parametrize("page", pages.PAGES, ids=pages.name)
def test_pages_have_no_archaic_turns(page):
    assert not [match[0] for match in ARCHAIC.finditer(pages.without_code(page))]


def strings(path):
    """What a source says to users: its strings."""
    text = path.read_text()
    if path.suffix == ".toml":
        return [value for value in leaves(tomllib.loads(text)) if isinstance(value, str)]
    if path.suffix == ".py":
        tree = ast.parse(text)
        private = docstrings(tree) if path.is_relative_to(pages.ROOT / "addon") else []
        return [node.value for node in ast.walk(tree) if is_text(node) and node not in private]
    return re.findall(r'"((?:[^"\\\n]|\\.)*)"', re.sub(r"//[^\n]*", "", text))


def docstrings(tree):
    """Those of functions and modules, which no user of the add-on sees: a class's is a tooltip."""
    owners = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.Module) and node.body]
    return [owner.body[0].value for owner in owners if isinstance(owner.body[0], ast.Expr)]


def leaves(value):
    children = value.values() if isinstance(value, dict) else value if isinstance(value, list) else None
    return [value] if children is None else [leaf for child in children for leaf in leaves(child)]


def is_text(node):
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def sources():
    for folder in ("native", "addon", "blender_scripts"):
        for path in sorted((pages.ROOT / folder).rglob("*.*")):
            if path.suffix in (".cpp", ".h", ".py", ".toml", ".cu"):
                yield path


def test_what_users_see_has_no_archaic_turns():
    """Messages, labels, sentences of options, docstrings."""
    archaic = {
        f"{path.relative_to(pages.ROOT)}: {match[0]} in {text[:80]!r}"
        for path in sources()
        for text in strings(path)
        for match in ARCHAIC.finditer(text)
    }
    assert not archaic


def main():
    words, total = 0, []
    for page in pages.PAGES:
        text = page.read_text()
        counted, count = sentences(text), len(text.split())
        mean = f"{len(counted):4} sentences {average(counted):5.1f} longest {max(counted, default=(0,))[0]:3}"
        print(f"{count:6} words {mean} {pages.name(page)}")
        words += 0 if page.name == "CHANGELOG.md" else count
        total += counted
    print(f"{words:6} words of README and docs; average {average(total):.1f}")


if __name__ == "__main__":
    main()
