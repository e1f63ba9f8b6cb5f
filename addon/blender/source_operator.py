# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that work on the panel's source and say before they are pressed why they would refuse."""

from .guide import Guided
from .language import translated
from .object_references import refusal, source_of


class SourceOperator(Guided):
    """Mixin: greyed out, the reason in the tooltip, where there is no source or `refuses` has a reason."""

    @classmethod
    def poll(cls, context):
        source = source_of(context)
        reason = refusal(source) or cls.refuses(source)
        if reason:
            cls.poll_message_set(translated(reason))
        return not reason

    @classmethod
    def refuses(cls, source):
        """Why the operator does not apply to a source, or None."""
        return None
