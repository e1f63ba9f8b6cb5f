# SPDX-License-Identifier: GPL-3.0-or-later
"""Record of a batch: a file per input, from which later runs and other machines see what to skip."""

import contextlib
import hashlib
import json
import os
from pathlib import Path

FOLDER = "arapfields-batch"
VERSION = 2
BATCH = "batch.json"  # the settings of all results; the file of an input has the input's suffix in its name
LOCK = "lock"


def described(verb, settings, version):
    """Verb, settings and version as JSON; files among the settings by their content, not their name."""
    description = {"version": version, "verb": verb}
    for name, value in sorted(settings.items()):
        is_file = isinstance(value, Path)
        description[name] = (
            digest(Path(value).read_text(encoding="utf-8", errors="surrogateescape")) if is_file else value
        )
    return description


def digest(content):
    """A short hash of a JSON value."""
    return hashlib.blake2b(json.dumps([VERSION, content]).encode(), digest_size=12).hexdigest()


def differences(then, now):
    """A phrase that names the differences of two descriptions."""
    names = [name for name in sorted({*then, *now}) if then.get(name) != now.get(name)]
    return ", ".join(
        f"{name} {then.get(name, 'unset')!s:.40} (now {now.get(name, 'unset')!s:.40})" for name in names
    )


def stamp(path):
    """A value that changes when the file does."""
    status = path.stat()
    return [status.st_size, status.st_mtime_ns]


class Record:
    """The record's folder beside the results: a file per input, replaced atomically; batches may share it."""

    def __init__(self, folder):
        self.folder = Path(folder) / FOLDER
        self._lock = None

    def place(self, name):
        """The file of an input's entry; very long names are shortened."""
        path = self.folder / f"{name}.json"
        if len(os.fsencode(path.name)) > 240:
            path = path.with_name(f"{digest(name)}.json")
        return path

    def entry(self, name):
        """The entry of an input; empty if it is missing or damaged."""
        return read(self.place(name))

    def is_damaged(self, name):
        return self.place(name).exists() and not self.entry(name)

    def is_done(self, name, source, target, options):
        """Whether the result exists, is newer than its source, and was made with the same options."""
        entry = self.entry(name)
        if entry.get("status") != "done" or entry.get("options") != options:
            return False
        if entry.get("output") != target.name or entry.get("source") != stamp(source):
            return False
        return target.is_file() and target.stat().st_mtime_ns >= source.stat().st_mtime_ns

    def note(self, name, **entry):
        self._write(self.place(name), {"input": name, **entry})

    def _write(self, path, content):
        from arapfields._files import json_text, write_text

        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, json_text({"format": VERSION, **content}, indent=1))

    def claim(self, name):
        """Claims an input for this process; False while another process holds it.

        The claim is a system lock on one byte, chosen by the name: it ends with the process, and holds on
        other machines if the shared file system supports locks. Without locks every claim is granted: an
        input may then be processed twice, with the same result.
        """
        from arapfields._locks import lock

        try:
            lock(self._locks(), byte_of(name), wait=False)
        except (BlockingIOError, PermissionError):
            return False
        except OSError:
            pass
        return True

    def release(self, name):
        from arapfields._locks import unlock

        unlock(self._locks(), byte_of(name))

    def _locks(self):
        if self._lock is None:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock = open(self.folder / LOCK, "ab")  # noqa: SIM115
        return self._lock

    def settings(self):
        """The settings of the folder's results; None if unknown."""
        settings = read(self.folder / BATCH).get("settings")
        return settings if isinstance(settings, dict) else None

    def agree(self, description, anew):
        """How these settings differ from the folder's; stores them if it has none, or with `anew`."""
        from arapfields._locks import lock

        with contextlib.suppress(OSError):
            lock(self._locks(), byte_of(BATCH))
        try:
            earlier = self.settings()
            other = differences(earlier, description) if earlier else ""
            if not earlier or (other and anew):
                self._write(self.folder / BATCH, {"settings": description})
            return other
        finally:
            self.release(BATCH)

    def close(self):
        if self._lock is not None:
            self._lock.close()
            self._lock = None


def byte_of(name):
    """The position of a name's byte in the lock file, which may be shorter."""
    return int.from_bytes(
        hashlib.blake2b(name.encode(errors="surrogateescape"), digest_size=7).digest(), "big"
    )


def read(path):
    """The JSON object of a file; {} if there is none."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError, ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) and content.get("format") == VERSION else {}
