# SPDX-License-Identifier: GPL-3.0-or-later
"""Empties that hold and move parts of an object."""
