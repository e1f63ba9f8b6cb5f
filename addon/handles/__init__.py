# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles: Empties and bones that hold and move parts of an object."""
