# SPDX-License-Identifier: GPL-3.0-or-later
"""Every text that a user may read is in the translations, and templates keep their fields."""

import string
import tempfile
from pathlib import Path

import pytest
from support.blender.inside import IN_BLENDER

if IN_BLENDER:
    from support.blender import strings

    from addon.blender import language
    from addon.blender.language import about, translated
    from addon.blender.translations import read_po, translations
    from addon.core.errors import UserError

pytestmark = pytest.mark.in_blender


def test_every_text_is_translated():
    texts = strings.every()
    assert len(texts) > 250

    def fields(text):
        return sorted(field for _, field, _, _ in string.Formatter().parse(text) if field)

    tables = translations()
    assert "de_DE" in tables
    for language, table in tables.items():
        missing = [text for text in texts if ("*", text) not in table]
        assert not missing, (language, missing)
        stale = {text for _, text in table} - set(texts) - strings.UNTRANSLATED
        assert not stale, (language, stale)
        for (_, text), translated in table.items():
            assert translated and fields(text) == fields(translated), text


def test_messages_are_filled_in_after_translation():
    assert translated("{count} frames baked", count=3) == "3 frames baked"
    assert translated(UserError("{name} is not a mesh object", name="{x}")) == "{x} is not a mesh object"
    assert translated(ValueError("as it is")) == "as it is"


def test_a_message_names_what_it_is_about_once():
    lost = UserError("{name} was deleted while it was worked on", name="Bar")
    said = "Bar was deleted while it was worked on"
    assert about("Bar", lost) == said and about("Bar", str(lost)) == said
    assert about("Hat", lost) == f"Hat: {said}"
    ended = UserError("{error}; live mode ended", error=lost)
    assert str(ended) == about("Bar", ended) == f"{said}; live mode ended"
    ended = UserError("{error}; live mode ended", error=ValueError("x"))
    assert about("Bar", ended) == "Bar: x; live mode ended"
    other = UserError("The bones of {name} are handles of {source}", name="Rig", source="Bar")
    assert about("Bar", other) == str(other)
    assert about("Bar", "Bars were deleted") == "Bar: Bars were deleted"


def test_an_error_within_another_is_translated():
    lookup, german = language._lookup, translations()["de_DE"]
    language._lookup = lambda text, _: german.get(("*", text), text)
    try:
        lost = UserError("{name} was deleted while it was worked on", name="Bar")
        ended = translated(UserError("{error}; live mode ended", error=lost))
    finally:
        language._lookup = lookup
    assert ended == "Bar wurde während der Arbeit gelöscht; Live-Modus beendet"


def test_wrapped_lines_and_every_form_of_a_po_file_are_read():
    path = Path(tempfile.mkdtemp()) / "de_DE.po"
    path.write_text(
        'msgid ""\nmsgstr "Content-Type: text/plain; charset=UTF-8\\n"\n\n'
        '# a remark\nmsgid ""\n"{name} was deleted "\n"while it was worked on"\n'
        'msgstr ""\n"{name} wurde gelöscht, "\n"während daran gearbeitet wurde"\n\n'
        'msgctxt "Operator"\nmsgid "Fit \\"it\\""\nmsgstr "„Anpassen“"\n\n'
        'msgid "not yet"\nmsgstr ""\n',
        encoding="utf-8",
    )
    texts = read_po(path)
    assert texts == {
        "{name} was deleted while it was worked on": "{name} wurde gelöscht, während daran gearbeitet wurde",
        'Fit "it"': "„Anpassen“",
    }
    path.write_text('msgid "a"\nnonsense\nmsgstr "b"\n')
    with pytest.raises(OSError):
        read_po(path)
