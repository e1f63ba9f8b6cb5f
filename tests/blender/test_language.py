# SPDX-License-Identifier: GPL-3.0-or-later
"""Every text that a user may read is in the catalogues, and templates keep their fields."""

from inside import in_blender


@in_blender
def test_every_text_is_translated():
    import string

    import strings

    from addon.blender.translations import catalogues

    texts = strings.every()
    assert len(texts) > 250

    def fields(text):
        return sorted(field for _, field, _, _ in string.Formatter().parse(text) if field)

    found = catalogues()
    assert "de_DE" in found
    for language, told in found.items():
        missing = [text for text in texts if ("*", text) not in told]
        assert not missing, (language, missing)
        stale = {text for _, text in told} - set(texts) - strings.UNTRANSLATED
        assert not stale, (language, stale)
        for (_, text), translated in told.items():
            assert translated and fields(text) == fields(translated), text


@in_blender
def test_messages_are_filled_in_after_translation():
    from addon.blender.language import translated
    from addon.core.errors import UserError

    assert translated("{count} frames baked", count=3) == "3 frames baked"
    assert translated(UserError("{name} is no mesh object", name="{x}")) == "{x} is no mesh object"
    assert translated(ValueError("as it is")) == "as it is"
