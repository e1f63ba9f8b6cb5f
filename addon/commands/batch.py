# SPDX-License-Identifier: GPL-3.0-or-later
"""batch: every file of a folder, each in a Blender of its own: one failure or crash stops no other."""

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
from .launch import PARENT
from .parser import FORMATS, solve_settings
from .record import NAME, Record, options_hash, stamp


@dataclass(frozen=True)
class Task:
    """One file of the batch."""

    name: str  # the input, relative to its folder
    source: Path
    target: Path


def run_batch(options, launch):
    """Works through the folder; exit code 0 when all is done, 1 when a file or an object failed."""
    begin = time.perf_counter()
    settings = solve_settings(options)
    if "handles" in settings and not settings["handles"].is_file():
        raise UserError(f"{settings['handles']}: no such file")
    tasks = plan(options)
    record = Record(options.output)
    if record.damaged:
        say(f"{record.path} is damaged; everything is done anew")
    digest = options_hash(options.solve_verb, settings, native.library().__version__)
    skipped = [t for t in tasks if not options.again and record.is_done(t.name, t.source, t.target, digest)]
    todo = [task for task in tasks if task not in skipped]
    for task in skipped:
        say(f"{task.name}: skipped, done already")
    if options.dry_run:
        for task in todo:
            say(f"{task.name}: would become {task.target}")
        return 0
    say(f"{len(todo)} of {len(tasks)} files to do, {options.jobs} at a time")
    failed = work(todo, options, settings, launch, record, digest)
    seconds = time.perf_counter() - begin
    figures = f"{len(todo) - failed} done, {len(skipped)} skipped, {failed} failed"
    say(f"{len(tasks)} files: {figures}, in {seconds:.0f} s; {options.output / NAME} tells more")
    return 1 if failed else 0


def plan(options):
    """The files to work on, in order of their names."""
    folder, output = options.input, options.output
    if not folder.is_dir():
        raise UserError(f"{folder}: no such folder (deform and stylize take single files)")
    if folder.resolve() == output.resolve():
        raise UserError(f"{output}: results would overwrite their sources; choose another folder")
    if output.exists() and not output.is_dir():
        raise UserError(f"{output}: is a file, not a folder")
    try:
        found = sorted(folder.rglob(options.pattern) if options.recursive else folder.glob(options.pattern))
    except (ValueError, NotImplementedError, IndexError) as error:
        raise UserError(f"--pattern: {options.pattern!r} is not a pattern of names ({error})") from None
    tasks = []
    for path in found:
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
    """Two inputs must not become one output; an OBJ's materials count."""
    taken = {}
    for task in tasks:
        for path in (
            {task.target, task.target.with_suffix(".mtl")} if task.target.suffix == ".obj" else {task.target}
        ):
            if path in taken:
                raise UserError(f"{taken[path]} and {task.name} would both become {path}; rename one")
            taken[path] = task.name


def work(todo, options, settings, launch, record, digest):
    """Runs the tasks, so many at a time; returns how many failed."""
    failed = number = 0
    environment = launch.environment(min(options.jobs, max(1, len(todo))))
    with ThreadPoolExecutor(options.jobs) as pool, Children(environment, options.limit) as children:
        waiting = {}
        for task in todo:
            task.target.parent.mkdir(parents=True, exist_ok=True)
            arguments = [*flags(settings), "--quiet", "-i", str(task.source), "-o", str(task.target)]
            command = launch.command(options.solve_verb, arguments)
            waiting[pool.submit(children.run, command)] = task, stamp(task.source)
        try:
            for future in as_completed(waiting):
                task, seen = waiting[future]
                outcome, number = future.result(), number + 1
                failed += outcome["status"] != "done"
                record.note(task.name, output=task.target.name, options=digest, source=seen, **outcome)
                say(f"[{number}/{len(todo)}] {task.name}: {describe(outcome)}")
        except BaseException:
            for future in waiting:
                future.cancel()
            children.stop()
            raise
    return failed


def flags(settings):
    """Settings as the arguments of the single verbs."""
    made = []
    for name, value in settings.items():
        flag = "--" + name.replace("_", "-")
        if isinstance(value, bool):
            made.append(flag if value else f"--no-{flag[2:]}")
        else:
            made += [flag, str(value.resolve() if isinstance(value, Path) else value)]
    return made


def describe(outcome):
    word = {"done": "done", "partial": "FAILED in part"}.get(outcome["status"], "FAILED")
    return f"{word} in {outcome['seconds']:.1f} s: {outcome['message']}"


class Children:
    """The Blenders at work; leaving the block ends those that still are."""

    def __init__(self, environment, limit):
        self.limit, self.running, self.stopped = limit, set(), False
        self.pipe, self.alive = os.pipe()  # nothing is ever written; the system closes it with this process
        self.environment = {**environment, PARENT: str(self.pipe)}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()
        os.close(self.pipe)
        os.close(self.alive)

    def stop(self):
        self.stopped = True
        for process in list(self.running):
            end(process)

    def run(self, command):
        """One file's outcome; never raises for what happens to the child."""
        begin = time.perf_counter()
        with tempfile.TemporaryDirectory(prefix="arapfields-") as folder:
            report, log = Path(folder) / "report.json", Path(folder) / "log"
            with log.open("wb") as stream:
                code = self.wait([*command, "--report", str(report)], stream)
            outcome = understand(code, report, log.read_text(errors="replace"))
        if code is None:
            outcome["message"] = f"given up after {self.limit:g} s"
        return {**outcome, "seconds": round(time.perf_counter() - begin, 2)}

    def wait(self, command, stream):
        """The child's exit code; None when it took too long."""
        if self.stopped:
            return 130
        process = subprocess.Popen(
            command,
            stdout=stream,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            env=self.environment,
            pass_fds=(self.pipe,),
            start_new_session=True,  # a Ctrl-C reaches the batch, which ends its children
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
    """Asks a child to stop, which leaves no partial files; one that does not listen is killed."""
    process.send_signal(signal.SIGINT)
    try:
        process.wait(5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def read_objects(report):
    """What a child says of its objects; nothing where it did not come to that."""
    try:
        objects = json.loads(report.read_text())["objects"]
        return [{**o, "status": str(o["status"]), "message": str(o["message"])} for o in objects]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return []


def understand(code, report, log):
    """{"status", "message", "objects"} from what a child left."""
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


def say(text):
    """A line; names of files may hold what the terminal cannot show."""
    print(text.encode(errors="backslashreplace").decode(), file=sys.stdout, flush=True)
