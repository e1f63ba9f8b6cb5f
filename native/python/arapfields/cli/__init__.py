# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line, `python -m arapfields`, with a verb for each step of the pipeline. See `--help`."""
