# SPDX-License-Identifier: GPL-3.0-or-later


class UserError(Exception):
    """What the user should read: which object, what is wrong, what to do."""
