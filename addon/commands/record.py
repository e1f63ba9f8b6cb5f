# SPDX-License-Identifier: GPL-3.0-or-later
"""What a batch has done: a file in the output folder, by which the next run knows what it may skip."""

import hashlib
import json
import os
from pathlib import Path

NAME = "arapfields-batch.json"
VERSION = 1


def options_hash(verb, settings, version):
    """A name for what is done to a file; the content of files among the settings counts, not their names."""
    parts = [VERSION, version, verb]
    for name, value in sorted(settings.items()):
        parts.append([name, Path(value).read_text() if isinstance(value, Path) else value])
    return hashlib.blake2b(json.dumps(parts).encode(), digest_size=12).hexdigest()


def stamp(path):
    """What changes when a file does."""
    found = path.stat()
    return [found.st_size, found.st_mtime_ns]


class Record:
    """{input: what was made of it}, written anew, whole, after each file."""

    def __init__(self, folder):
        self.path = Path(folder) / NAME
        self.damaged = False
        self.entries = self._read()

    def _read(self):
        try:
            content = json.loads(self.path.read_text())
            entries = content["files"]
            assert content["version"] == VERSION and isinstance(entries, dict)
            return entries
        except FileNotFoundError:
            return {}
        except (ValueError, KeyError, TypeError, AssertionError):
            self.damaged = True
            return {}

    def is_done(self, name, source, target, options):
        """Whether the result is there, newer than its source, and made with the same options."""
        entry = self.entries.get(name)
        if not isinstance(entry, dict) or entry.get("status") != "done" or entry.get("options") != options:
            return False
        if entry.get("output") != target.name or entry.get("source") != stamp(source):
            return False
        return target.is_file() and target.stat().st_mtime_ns >= source.stat().st_mtime_ns

    def note(self, name, **entry):
        self.entries[name] = entry
        self.path.parent.mkdir(parents=True, exist_ok=True)
        partial = self.path.with_name(f".{NAME}.{os.getpid()}")
        partial.write_text(json.dumps({"version": VERSION, "files": self.entries}, indent=1))
        os.replace(partial, self.path)
