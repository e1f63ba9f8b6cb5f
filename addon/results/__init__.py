# SPDX-License-Identifier: GPL-3.0-or-later
"""What was made of a source, and where it goes."""
