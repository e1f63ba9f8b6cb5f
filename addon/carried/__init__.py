# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that a source's field moves as well: clothes, eyes, hair, lattices, Empties."""
