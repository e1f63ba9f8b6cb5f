# SPDX-License-Identifier: GPL-3.0-or-later
"""The source's implicit surface, exact or fitted, its samples and its extraction."""
