# SPDX-License-Identifier: GPL-3.0-or-later
"""batch: every file of a folder, each in a separate Blender process, so that a crash stops no other file."""

import contextlib
import hashlib
import json
import os
import sys
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from ..core.errors import UserError
from ..core.runtime import native
from .children import Children
from .parser import FORMATS, solve_settings

# Record of a batch: a file per input, from which later runs and other machines see what to skip.

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


# batch: every file of a folder, each in a separate Blender process, so that a crash stops no other file.

LOOK = 1.0  # seconds between checks of the files that other batches work on


@dataclass(frozen=True)
class Task:
    """One file of the batch."""

    name: str  # the input, relative to its folder
    source: Path
    target: Path


def run_batch(options, launch):
    """Processes the folder; returns exit code 0 if all is done, 1 if a file or an object failed."""
    begin = time.perf_counter()
    settings = solve_settings(options)
    if "handles" in settings and not settings["handles"].is_file():
        raise UserError(f"{settings['handles']}: no such file")
    everything = plan(options)
    number, parts = options.shard or (1, 1)
    tasks = everything[number - 1 :: parts]
    record = Record(options.output)
    description = described(options.solve_verb, settings, native.library().__version__)
    options_name = digest(description)
    skipped = [
        t for t in tasks if not options.again and record.is_done(t.name, t.source, t.target, options_name)
    ]
    todo = [task for task in tasks if task not in skipped]
    for task in skipped:
        say(f"{task.name}: skipped, done already")
    for task in todo:
        if record.is_damaged(task.name):
            say(f"{record.place(task.name)} is damaged; {task.name} is done anew")
    if options.dry_run:
        for task in todo:
            say(f"{task.name}: would become {task.target}")
        return 0
    agree(options, record, description)
    of = f", the part {number}/{parts} of {len(everything)}" if options.shard else ""
    say(f"{len(todo)} of {len(tasks)} files to do{of}, {options.jobs} at a time")
    try:
        counts = Work(options, settings, launch, record, description).run(todo)
    finally:
        record.close()
    seconds = time.perf_counter() - begin
    figures = f"{counts['done']} done, {len(skipped) + counts['skipped']} skipped, {counts['failed']} failed"
    say(f"{len(tasks)} files: {figures}, in {seconds:.0f} s; {record.folder} tells more")
    return 1 if counts["failed"] else 0


def agree(options, record, description):
    """Reports results of other settings or versions in the folder; UserError for a shard if there are any."""
    other = record.agree(description, anew=options.again or not options.shard)
    if other and options.shard and not options.again:
        raise UserError(
            f"{options.output}: holds results made with {other}; the parts of one job must agree: "
            "choose another folder, or --again"
        )
    if other:
        say(f"{options.output}: holds results made with {other}; those are done anew")


def plan(options):
    """The Tasks, sorted by path."""
    folder, output = options.input, options.output
    if not folder.is_dir():
        raise UserError(f"{folder}: no such folder (deform and stylize take single files)")
    if folder.resolve() == output.resolve():
        raise UserError(f"{output}: results would overwrite their sources; choose another folder")
    if output.exists() and not output.is_dir():
        raise UserError(f"{output}: is a file, not a folder")
    try:
        paths = sorted(folder.rglob(options.pattern) if options.recursive else folder.glob(options.pattern))
    except (ValueError, NotImplementedError, IndexError) as error:
        raise UserError(f"--pattern: {options.pattern!r} is not a pattern of names ({error})") from None
    tasks = []
    for path in paths:
        suffix = path.suffix.lower().lstrip(".")
        if suffix not in FORMATS or path.name.startswith(".") or output.resolve() in path.resolve().parents:
            continue
        if path.is_file():
            name = path.relative_to(folder)
            target = output / name.with_suffix(f".{options.format or suffix}")
            tasks.append(Task(name.as_posix(), path, target))
    if not tasks:
        raise UserError(f"{folder}: holds no {', '.join('.' + name for name in FORMATS)} file")
    refuse_twins(tasks)
    return tasks


def refuse_twins(tasks):
    """UserError if two inputs have the same output, or the same material file of an OBJ."""
    taken = {}
    for task in tasks:
        for path in (
            {task.target, task.target.with_suffix(".mtl")} if task.target.suffix == ".obj" else {task.target}
        ):
            if path in taken:
                raise UserError(f"{taken[path]} and {task.name} would both become {path}; rename one")
            taken[path] = task.name


class Work:
    """Processes files in parallel; several batches may share a folder, and each file is claimed by one."""

    def __init__(self, options, settings, launch, record, description):
        self.options, self.flags, self.launch, self.record = options, flags(settings), launch, record
        self.digest = digest(description)
        self.again = options.again

    def run(self, todo):
        """Returns the numbers of files done, skipped (done by another batch) and failed."""
        counts, number = {"done": 0, "skipped": 0, "failed": 0}, 0
        environment = self.launch.environment(min(self.options.jobs, max(1, len(todo))))
        with (
            ThreadPoolExecutor(self.options.jobs) as pool,
            Children(environment, self.options.limit) as children,
        ):
            waiting = {pool.submit(self.one, task, children): task for task in todo}
            try:
                while waiting:
                    later = []
                    for future in as_completed(waiting):
                        task, outcome = waiting[future], future.result()
                        if outcome is None:
                            later.append(task)
                            continue
                        status = outcome["status"]
                        counts[status if status in counts else "failed"] += 1
                        number += 1
                        say(f"[{number}/{len(todo)}] {task.name}: {describe(outcome)}")
                    if later:  # claimed by another batch; taken over if that ends without a result
                        time.sleep(LOOK)
                    waiting = {pool.submit(self.one, task, children): task for task in later}
            except BaseException:
                for future in waiting:
                    future.cancel()
                children.stop()
                raise
        return counts

    def one(self, task, children):
        """The outcome of one file; None while another batch works on it."""
        if not self.record.claim(task.name):
            return None
        try:
            if not self.again and self.record.is_done(task.name, task.source, task.target, self.digest):
                return {"status": "skipped", "message": "done by another batch", "seconds": 0.0}
            task.target.parent.mkdir(parents=True, exist_ok=True)
            seen = stamp(task.source)
            arguments = [*self.flags, "--quiet", "-i", str(task.source), "-o", str(task.target)]
            outcome = children.run(self.launch.command(self.options.solve_verb, arguments))
            if not children.stopped:
                entry = {"output": task.target.name, "options": self.digest, "source": seen}
                self.record.note(task.name, **entry, **outcome)
            return outcome
        finally:
            self.record.release(task.name)


def flags(settings):
    """The settings as flags of the verb for one file."""
    arguments = []
    for name, value in settings.items():
        flag = "--" + name.replace("_", "-")
        if isinstance(value, list):
            arguments += [part for one in value for part in (flag, one)]
        elif isinstance(value, bool):
            arguments.append(flag if value else f"--no-{flag[2:]}")
        else:
            arguments += [flag, str(value.resolve() if isinstance(value, Path) else value)]
    return arguments


def describe(outcome):
    word = {"done": "done", "skipped": "skipped", "partial": "FAILED in part"}.get(
        outcome["status"], "FAILED"
    )
    return f"{word} in {outcome['seconds']:.1f} s: {outcome['message']}"


def say(text):
    """Prints a line; characters that the terminal cannot show are escaped."""
    print(text.encode(errors="backslashreplace").decode(), file=sys.stdout, flush=True)
