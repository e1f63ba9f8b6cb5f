# SPDX-License-Identifier: GPL-3.0-or-later
"""Mixins of operators on the panel's source that are greyed out with a reason when they cannot run."""

import numpy as np

from ..core.errors import UserError
from ..core.geometry.spaces import space_of
from .evaluation import world_matrix
from .guide import Guided
from .language import translated
from .object_references import refusal, refusal_of_linked, source_of


class ReportingOperator(Guided):
    """Mixin: `change(context, source)` does the work and returns the line to report, if any.

    Errors become reports. `source`: the panel's, or None.
    """

    def execute(self, context):
        context.view_layer.update()
        source = source_of(context)
        try:
            line = self.change(context, source)
        except np.linalg.LinAlgError as error:
            return self.refuse(flat(source) or error)
        except (UserError, ValueError, OSError) as error:
            return self.refuse(error)
        if line:
            self.report({"INFO"}, line)
        self.warn(context)
        return {"FINISHED"}

    def warn(self, context):
        """Reports warnings after the work is done."""

    def refuse(self, error):
        self.report({"ERROR"}, translated(error))
        return {"CANCELLED"}


def flat(source):
    """UserError if a source's scale flattens it; None otherwise, or without a source."""
    try:
        if source is not None:
            space_of(world_matrix(source), source.name)
    except UserError as error:
        return error
    return None


class SourceOperator(ReportingOperator):
    """Mixin: needs a source for which `refuses` gives no reason."""

    in_edit_mode = False  # whether it also accepts a source in Edit Mode
    of_linked = False  # whether it also accepts a linked source, which it does not change

    @classmethod
    def obstacle(cls, context):
        source = source_of(context)
        reason = refusal(source, cls.in_edit_mode)
        if reason is None and not cls.of_linked:
            reason = refusal_of_linked(source)
        return reason or cls.refuses(source)

    @classmethod
    def refuses(cls, source):
        """UserError that says why the operator does not apply to a source; else None."""
        return None
