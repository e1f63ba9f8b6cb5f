# SPDX-License-Identifier: GPL-3.0-or-later
"""batch: every file of a folder, each in a separate Blender process, so that a crash stops no other file."""

import contextlib
import ctypes
import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from ..core.errors import UserError
from ..core.runtime import native
from ..core.runtime.threads import start_thread
from .parser import FORMATS, solve_settings

# The Blender processes that a batch starts, one per file, and their outcomes.

# Starts other Blender processes like this one, for the files of a batch.

# Descriptor of a pipe that the system closes when the batch ends or is killed; on Windows the batch's ID.
PARENT = "ARAPFIELDS_PARENT"
PATIENCE = 5.0  # seconds from the interrupt of a child until it is ended by force


def end_with_parent():
    """In a child of a batch: interrupts this process once the batch has ended or was killed."""
    try:
        parent = int(os.environ.pop(PARENT, ""))
    except ValueError:
        return

    def watch():
        if os.name == "nt":
            wait_for_process(parent)
        else:
            try:
                os.read(parent, 1)
            except OSError:
                return  # not a child of a batch
        # An interrupt leaves no partial file; on Windows os.kill would end the process at once.
        if os.name == "nt":
            signal.raise_signal(signal.SIGTERM)
        else:
            os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(PATIENCE)
        os._exit(130)

    start_thread("parent", watch)


def wait_for_process(number):
    """Waits until a process ends, on Windows."""
    kernel, synchronize, ever = ctypes.WinDLL("kernel32"), 0x100000, 0xFFFFFFFF
    kernel.OpenProcess.restype = ctypes.c_void_p
    process = kernel.OpenProcess(synchronize, False, number)  # None for a process that has ended
    kernel.WaitForSingleObject(ctypes.c_void_p(process), ever)


class Launch:
    """The command with which this Blender was started, to start others."""

    def __init__(self, script=None):
        self.script = Path(script).resolve() if script else None

    def command(self, verb, arguments):
        """The command line of a verb for one file."""
        import bpy

        from ..blender import host

        if self.script and host.is_module():
            return [sys.executable, str(self.script.with_name(f"{verb}.py")), *arguments]
        given = list(sys.argv[1:])
        if self.script:
            place = given.index("--")
            before = [*given[:place], "--"]
            at = next(i for i, text in enumerate(before) if text in ("-P", "--python")) + 1
            before[at] = str(self.script.with_name(f"{verb}.py"))
            return [bpy.app.binary_path, *before, *arguments]
        at = next(i for i, text in enumerate(given) if text in ("-c", "--command"))
        return [bpy.app.binary_path, *given[: at + 2], verb, *arguments]

    def environment(self, jobs):
        """The environment of children, with the processors divided among `jobs` processes."""
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        threads = os.environ.get("OMP_NUM_THREADS") or str(max(1, cores // jobs))
        return {**os.environ, "OMP_NUM_THREADS": threads, "PYTHONUNBUFFERED": "1"}


# The Blender processes that a batch starts, one per file, and their outcomes.

WINDOWS = os.name == "nt"


class Children:
    """Context manager of the running Blender processes; ends those that still run when it is left."""

    def __init__(self, environment, limit):
        self.limit, self.running, self.stopped = limit, set(), False
        # Nothing is written to the pipe; the system closes it with this process. On Windows a child inherits
        # only the standard streams, and no child starts while another one reads its input.
        self.pipe = () if WINDOWS else os.pipe()
        self.environment = {**environment, PARENT: str(os.getpid() if WINDOWS else self.pipe[0])}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()
        for descriptor in self.pipe:
            os.close(descriptor)

    def stop(self):
        self.stopped = True
        for process in list(self.running):
            end(process)

    def run(self, command):
        """The outcome of one file; failures of the child are outcomes, not exceptions."""
        begin = time.perf_counter()
        with tempfile.TemporaryDirectory(prefix="arapfields-") as folder:
            report, log = Path(folder) / "report.json", Path(folder) / "log"
            with log.open("wb") as stream:
                code = self.wait([*command, "--report", str(report)], stream)
            outcome = understand(code, report, log.read_text(encoding="utf-8", errors="replace"))
        if code is None:
            outcome["message"] = f"given up after {self.limit:g} s"
        return {**outcome, "seconds": round(time.perf_counter() - begin, 2)}

    def ties(self):
        """Arguments of Popen: a child gets the pipe, and no Ctrl-C, for which the batch ends its children."""
        if WINDOWS:
            return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
        return {"pass_fds": self.pipe[:1], "start_new_session": True}

    def wait(self, command, stream):
        """The child's exit code; None after the time limit."""
        if self.stopped:
            return 130
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=stream,
            stderr=subprocess.STDOUT,
            env=self.environment,
            **self.ties(),
        )
        self.running.add(process)
        try:
            return process.wait(self.limit)
        except subprocess.TimeoutExpired:
            end(process)
            return None
        finally:
            self.running.discard(process)


def end(process):
    """Interrupts a child, which leaves no partial files; kills it if it does not end in time."""
    with contextlib.suppress(OSError, SystemError):  # Windows sends the signal only through a console
        process.send_signal(signal.CTRL_BREAK_EVENT if WINDOWS else signal.SIGINT)
    try:
        process.wait(5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def read_objects(report):
    """The outcomes of objects in a child's report; [] without a report."""
    try:
        objects = json.loads(report.read_text(encoding="utf-8"))["objects"]
        return [{**o, "status": str(o["status"]), "message": str(o["message"])} for o in objects]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return []


def understand(code, report, log):
    """{"status", "message", "objects"} from a child's exit code, report and log."""
    objects = read_objects(report)
    failures = [o["message"] for o in objects if o["status"] != "done"]
    if code == 0 and objects:
        return {"status": "done", "message": "; ".join(o["message"] for o in objects), "objects": objects}
    if failures:
        status = "partial" if len(failures) < len(objects) else "failed"
        return {"status": status, "message": "; ".join(failures), "objects": objects}
    said = [line for line in log.splitlines() if line.startswith("arapfields")]
    last = said[-1:] or [line for line in log.splitlines() if line.strip()][-1:] or ["it said nothing"]
    reason = last[0].removeprefix("arapfields: ")
    if code is not None and code < 0:
        reason = f"Blender was ended by signal {-code} ({reason})"
    return {"status": "failed", "message": reason, "objects": objects}


# batch: every file of a folder, each in a separate Blender process, so that a crash stops no other file.

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
        from arapfields._files import lock

        try:
            lock(self._locks(), byte_of(name), wait=False)
        except (BlockingIOError, PermissionError):
            return False
        except OSError:
            pass
        return True

    def release(self, name):
        from arapfields._files import unlock

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
        from arapfields._files import lock

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
