# SPDX-License-Identifier: GPL-3.0-or-later
"""What build_extension.py is made of: a zip, its guide, its check."""
