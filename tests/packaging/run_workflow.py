# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the GitHub workflows' jobs for Linux on this machine, step by step, each job in a fresh clone.

python tests/packaging/run_workflow.py .github/workflows/tests.yml [--job NAME] [--matrix python=3.11]

Commands of steps run in the same shell as at GitHub. Steps that need GitHub are substituted, and those that
cannot run here are reported with the reason: system packages are not installed, containers are replaced by
this system, and jobs for other systems are left out. Exit code 1 if a step fails.
"""

import argparse
import itertools
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
INSTALLER = re.compile(r"^(sudo )?(apt-get|yum|dnf|apk|brew|choco)\b")
CONTAINER_PYTHON = re.compile(r"/opt/python/cp(\d)(\d+)-cp\d+")
KEPT = ("PATH", "HOME", "LANG", "LC_ALL", "TMPDIR", "SSL_CERT_FILE", "ARAPFIELDS_DATA")


def combinations(job):
    """The combinations of the matrix as dicts; one empty dict without a matrix."""
    matrix = dict(job.get("strategy", {}).get("matrix", {}))
    extra = matrix.pop("include", [])
    found = [dict(zip(matrix, values, strict=True)) for values in itertools.product(*matrix.values())]
    for more in extra:
        fitting = [c for c in found if all(c[key] == more[key] for key in more if key in matrix)]
        for combination in fitting if matrix else []:
            combination.update(more)
        if not fitting or not matrix:
            found.append(dict(more))
    return [c for c in found if c] or [{}]


def filled(text, values):
    """The text with expressions of matrix and environment replaced."""

    def value(match):
        expression = match[1].strip()
        negated = expression.startswith("!")
        name = expression.lstrip("! ")
        place, _, key = name.partition(".")
        if place != "matrix" or not re.fullmatch(r"[\w-]+", key):
            raise ValueError(f"the expression {expression!r} is not known here")
        found = values.get(key, "")
        return ("" if found else "true") if negated else str(found)

    return re.sub(r"\$\{\{(.*?)\}\}", value, str(text))


def plan(step, values):
    """("run" | "substitute" | "left out", command or reason) of a step."""
    condition = step.get("if")
    if condition is not None and not filled(condition, values).strip():
        return "left out", "its condition does not hold"
    if "uses" in step:
        action = step["uses"].partition("@")[0]
        if action not in ACTIONS:
            return "left out", f"{action} has no substitute here"
        return "substitute", action
    command = filled(step["run"], values)
    lines = [part.strip() for part in re.split(r"\n|&&", command) if part.strip()]
    if all(INSTALLER.match(line) for line in lines):
        return "left out", "installs packages of the system: " + command.strip()
    return "run", command


def interpreter(version, path):
    """A Python that starts, from `path` or from pyenv, whose shims may lead to none."""
    candidates = [shutil.which(f"python{version}", path=path)]
    candidates += sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python{version}"))
    for candidate in filter(None, candidates):
        if subprocess.run([candidate, "-c", ""], capture_output=True).returncode == 0:
            return candidate
    raise RuntimeError(f"there is no python{version} here")


class Job:
    """A job of a workflow with a combination of its matrix, in `folder`."""

    def __init__(self, content, values, folder, limit, keep=()):
        self.content, self.values, self.folder, self.limit = content, values, folder, limit
        self.clone, self.files = folder / "clone", folder / "github"
        self.container = filled(content.get("container", ""), values)
        shutil.rmtree(folder, ignore_errors=True)
        self.files.mkdir(parents=True)
        self.environment = {name: os.environ[name] for name in (*KEPT, *keep) if name in os.environ}
        own = str(Path(sys.executable).parent)  # not available in the workflow
        folders = [part for part in self.environment["PATH"].split(os.pathsep) if part != own]
        self.environment |= {"PATH": os.pathsep.join(folders), "CI": "true", "GITHUB_ACTIONS": "true"}
        self.environment |= {str(key): filled(value, values) for key, value in content.get("env", {}).items()}
        for name in ("GITHUB_PATH", "GITHUB_ENV"):
            (self.files / name).touch()
            self.environment[name] = str(self.files / name)

    def python(self, version):
        """The folder of programs of a fresh environment with this Python."""
        place = self.folder / f"python{version}"
        if not place.exists():
            python = interpreter(version, self.environment["PATH"])
            subprocess.run([python, "-m", "venv", place], check=True, capture_output=True)
        return place / "bin"

    def run(self, step):
        command = CONTAINER_PYTHON.sub(
            lambda found: str(self.python(f"{found[1]}.{found[2]}").parent), filled(step["run"], self.values)
        )
        shell = ["sh", "-e"] if self.container else ["bash", "-e"]
        if step.get("shell") == "bash":
            shell = ["bash", "--noprofile", "--norc", "-eo", "pipefail"]
        script = self.files / "step.sh"
        script.write_text(command)
        environment = self.environment | {
            str(key): filled(value, self.values) for key, value in step.get("env", {}).items()
        }
        process = subprocess.Popen([*shell, script], cwd=self.clone, env=environment, start_new_session=True)
        try:
            code = process.wait(self.limit)
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)  # the shell and its children
            process.wait()
            raise
        if code:
            raise subprocess.CalledProcessError(code, list(map(str, process.args)))
        self.take_over()

    def take_over(self):
        """Reads the environment variables and paths that the step set for later steps."""
        for line in (self.files / "GITHUB_PATH").read_text().split():
            place = CONTAINER_PYTHON.sub(lambda f: str(self.python(f"{f[1]}.{f[2]}").parent), line)
            self.environment["PATH"] = f"{place}{os.pathsep}{self.environment['PATH']}"
        lines = (self.files / "GITHUB_ENV").read_text().splitlines()
        self.environment |= dict(line.split("=", 1) for line in lines)
        for name in ("GITHUB_PATH", "GITHUB_ENV"):
            (self.files / name).write_text("")

    def substitute(self, step):
        ACTIONS[step["uses"].partition("@")[0]](self, step.get("with", {}))

    def steps(self):
        """(name, "ran" | "substituted" | "left out" | "failed", seconds or reason) of each step, in order."""
        for step in self.content["steps"]:
            name = step.get("name") or step.get("uses") or step["run"].strip().splitlines()[0]
            kind, what = plan(step, self.values)
            if kind == "left out":
                yield name, kind, what
                continue
            begin = time.perf_counter()
            try:
                self.run(step) if kind == "run" else self.substitute(step)
            except subprocess.TimeoutExpired:
                yield name, "failed", f"not done after {self.limit:g} s"
                return
            except (subprocess.CalledProcessError, RuntimeError) as error:
                yield name, "failed", str(error)
                return
            yield name, "ran" if kind == "run" else "substituted", f"{time.perf_counter() - begin:.0f} s"


def check_out(job, _):
    """Clones the last commit, without uncommitted changes."""
    subprocess.run(["git", "clone", "-q", "--local", ROOT, job.clone], check=True)


def set_up_python(job, given):
    version = filled(given["python-version"], job.values)
    job.environment["PATH"] = f"{job.python(version)}{os.pathsep}{job.environment['PATH']}"


def upload(job, given):
    """Copies the files that GitHub would store; it is an error if there are none and the step says so."""
    patterns = filled(given["path"], job.values)
    files = [path for pattern in patterns.split() for path in sorted(job.clone.glob(pattern))]
    if not files and given.get("if-no-files-found") == "error":
        raise RuntimeError(f"there is nothing like {patterns}")
    place = job.folder / "artifacts" / filled(given["name"], job.values)
    place.mkdir(parents=True, exist_ok=True)
    for path in files:
        shutil.copy2(path, place)


ACTIONS = {
    "actions/checkout": check_out,
    "actions/setup-python": set_up_python,
    "actions/upload-artifact": upload,
}


def jobs(path):
    """(name, content, combination) of all jobs of a workflow."""
    listed = yaml.safe_load(path.read_text(encoding="utf-8"))["jobs"].items()
    return [(name, content, values) for name, content in listed for values in combinations(content)]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("workflow", type=Path, nargs="+")
    parser.add_argument("--job", help="this one alone")
    parser.add_argument(
        "--matrix", nargs="*", default=[], metavar="NAME=VALUE", help="these combinations alone"
    )
    parser.add_argument("--folder", type=Path, default=ROOT / "build/workflows")
    parser.add_argument("--limit", type=float, default=7200.0, help="seconds for a step")
    parser.add_argument("--keep", nargs="*", default=[], metavar="NAME", help="variables to hand on")
    parser.add_argument("--plan", action="store_true", help="say what would be done, and do nothing")
    return parser.parse_args()


def main(options):
    wanted, told, failed = dict(text.split("=", 1) for text in options.matrix), [], False
    for path in options.workflow:
        for name, content, values in jobs(path):
            if options.job not in (None, name) or any(values.get(k) != v for k, v in wanted.items()):
                continue
            label = " ".join([path.stem, name, *map(str, (v for k, v in values.items() if k != "container"))])
            system = filled(content["runs-on"], values)
            if not system.startswith("ubuntu") or system.endswith("-arm"):
                told.append((label, "all steps", "left out", f"needs {system}"))
            elif options.plan:
                steps = [
                    (s.get("name") or s.get("uses") or s["run"], *plan(s, values)) for s in content["steps"]
                ]
                told += [(label, *step) for step in steps]
            else:
                folder = options.folder.resolve() / label.replace(" ", "-")
                for step in Job(content, values, folder, options.limit, options.keep).steps():
                    told.append((label, *step))
                    print(" · ".join(told[-1]), flush=True)
                    failed |= step[1] == "failed"
    if not options.plan:
        options.folder.mkdir(parents=True, exist_ok=True)
        (options.folder / "report.json").write_text(json.dumps(told, indent=1) + "\n")
    print("\n".join(["", "| job | step | | |", "|---|---|---|---|"]))
    for row in told:
        print("| " + " | ".join(" ".join(text.split()) for text in row) + " |")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(arguments()))
