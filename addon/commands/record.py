# SPDX-License-Identifier: GPL-3.0-or-later
"""What a batch has done: a file an input, by which the next run, or another machine, knows what to skip."""

import contextlib
import hashlib
import json
import os
from pathlib import Path

FOLDER = "arapfields-batch"
VERSION = 2
BATCH = (
    "batch.json"  # what the folder's results have in common; an input's own file has a name with its suffix
)
LOCK = "lock"


def described(verb, settings, version):
    """What is done to an input, as JSON; of files among the settings the content counts, not their names."""
    description = {"version": version, "verb": verb}
    for name, value in sorted(settings.items()):
        is_file = isinstance(value, Path)
        description[name] = (
            digest(Path(value).read_text(encoding="utf-8", errors="surrogateescape")) if is_file else value
        )
    return description


def digest(content):
    """A short name for what JSON can hold."""
    return hashlib.blake2b(json.dumps([VERSION, content]).encode(), digest_size=12).hexdigest()


def differences(then, now):
    """A phrase for what two descriptions do not share."""
    names = [name for name in sorted({*then, *now}) if then.get(name) != now.get(name)]
    return ", ".join(
        f"{name} {then.get(name, 'unset')!s:.40} (now {now.get(name, 'unset')!s:.40})" for name in names
    )


def stamp(path):
    """What changes when a file does."""
    status = path.stat()
    return [status.st_size, status.st_mtime_ns]


class Record:
    """The folder beside the results: a file an input, each written whole. Several batches may share it."""

    def __init__(self, folder):
        self.folder = Path(folder) / FOLDER
        self._lock = None

    def place(self, name):
        """Where the entry of an input is kept; a very long name is shortened."""
        path = self.folder / f"{name}.json"
        if len(os.fsencode(path.name)) > 240:
            path = path.with_name(f"{digest(name)}.json")
        return path

    def entry(self, name):
        """What is noted of an input; nothing where that is damaged."""
        return read(self.place(name))

    def is_damaged(self, name):
        return self.place(name).exists() and not self.entry(name)

    def is_done(self, name, source, target, options):
        """Whether the result is there, newer than its source, and made with the same options."""
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
        """Whether this process alone works on the input from now on; False while another one does.

        A lock of the system's, on a byte that the name chooses: it ends with the process, however that ends,
        and reaches other machines where their folder is shared with locks. Without locks all claims are
        granted: an input may then be done twice, with one result.
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
        """What the folder's results are made with; None where nothing tells."""
        settings = read(self.folder / BATCH).get("settings")
        return settings if isinstance(settings, dict) else None

    def agree(self, description, anew):
        """What differs between these settings and those of the folder, which become these where `anew`."""
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
    """A byte of the lock's file, which need not be as long."""
    return int.from_bytes(
        hashlib.blake2b(name.encode(errors="surrogateescape"), digest_size=7).digest(), "big"
    )


def read(path):
    """An object of a file; an empty one where there is none, or something else."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError, ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) and content.get("format") == VERSION else {}
