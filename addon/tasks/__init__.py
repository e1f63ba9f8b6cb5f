# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel's row of tasks: which sections it shows."""
