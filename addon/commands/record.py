# SPDX-License-Identifier: GPL-3.0-or-later
"""What a batch has done: a file in the output folder, by which the next run knows what it may skip."""

import contextlib
import fcntl
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
    """{input: what was made of it}, written anew, whole, after each file; several batches may share one."""

    def __init__(self, folder):
        self.path = Path(folder) / NAME
        self.entries, self.damaged = self._read()

    def _read(self):
        """The entries on the disk, and whether they are damaged."""
        try:
            content = json.loads(self.path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            return {}, False
        except (ValueError, RecursionError):
            return {}, True
        known = isinstance(content, dict) and content.get("version") == VERSION
        if not known or not isinstance(content.get("files"), dict):
            return {}, True
        return content["files"], False

    def is_done(self, name, source, target, options):
        """Whether the result is there, newer than its source, and made with the same options."""
        entry = self.entries.get(name)
        if not isinstance(entry, dict) or entry.get("status") != "done" or entry.get("options") != options:
            return False
        if entry.get("output") != target.name or entry.get("source") != stamp(source):
            return False
        return target.is_file() and target.stat().st_mtime_ns >= source.stat().st_mtime_ns

    def note(self, name, **entry):
        """Adds an entry to what is on the disk by now: another batch may have noted its own."""
        from arapfields._files import json_text, write_text

        self.path.parent.mkdir(parents=True, exist_ok=True)
        with locked(self.path.parent):
            there, damaged = self._read()
            self.entries = {**(self.entries if damaged else there), name: entry}
            write_text(self.path, json_text({"version": VERSION, "files": self.entries}, indent=1))


@contextlib.contextmanager
def locked(folder):
    """No other process is in such a block with the same folder."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
