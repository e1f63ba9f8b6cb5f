# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of build_extension.py: the zip, its guide, its check."""
