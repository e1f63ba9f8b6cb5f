# SPDX-License-Identifier: GPL-3.0-or-later
"""Wrapping an object onto another: a template onto a scan."""
