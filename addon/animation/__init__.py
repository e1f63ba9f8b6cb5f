# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes and exports of animations."""
