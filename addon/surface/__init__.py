# SPDX-License-Identifier: GPL-3.0-or-later
"""The source: its implicit surface, fitted and extracted, and its samples."""
