# SPDX-License-Identifier: GPL-3.0-or-later
"""wrap with a folder as its target: one template onto each mesh; existing results are skipped."""

import json
from pathlib import Path

import arapfields as af

from .._files import existing_file, json_text
from .._streams import say
from . import contact_sheet, files, sources
from .options import given
from .running import Outputs, with_progress
from .wrap_frames import made_of

ONE_TARGET = ("landmark", "landmarks", "save_field", "suggest")  # flags for a single target


def run(args, options):
    """Wraps onto each mesh; InvalidInput at the end if some failed."""
    output, template = output_folder(args), existing_file(args.input, files.MESH_SUFFIXES)
    everything = meshes_in(args.target)
    output.mkdir(parents=True, exist_ok=True)
    source = sources.Source(args)
    samples = sources.samples(source, given(args, "wrap", "samples"), options.seed, args)
    common = made_of(samples, options, template.read_bytes())
    done, failed = {}, []
    number, parts = args.shard or (1, 1)
    for path in everything[number - 1 :: parts]:
        place = output / f"{path.stem}{template.suffix.lower()}"
        mark = common.copy()
        try:
            mark.update(sources.content(path))
            done[path.name] = read_done(place, mark) or wrap_one(
                place, mark, lambda path=path: sources.read_distance(path), source, samples, options, args
            )
        except (af.InvalidInput, af.Diverged) as error:
            failed.append(f"{path.name}: {error}")
    if not args.quiet:
        for name in sorted(done, key=lambda name: -off(done[name])):
            notes = "; ".join(done[name]["notes"])
            say(f"{name}: {off(done[name]):.2%} of the target's size off{notes and '; ' + notes}", "stdout")
    if done:
        write_sheet(output, everything, template.suffix.lower())
    refuse(failed, len(done) + len(failed))


def output_folder(args):
    """The folder of the wrapped meshes; InvalidInput for flags of single targets."""
    for name in ONE_TARGET:
        if getattr(args, name):
            raise af.InvalidInput(f"--{name.replace('_', '-')}: {args.target} is a folder; wrap one by one")
    output = Path(args.output or "")
    is_file = output.suffix or output.is_file()
    if not args.output or is_file or (output.is_dir() and output.samefile(args.target)):
        raise af.InvalidInput("--output: another folder is needed where the target is one")
    return output


def meshes_in(folder):
    """The mesh files of a folder; InvalidInput if two have the same stem."""
    everything = sorted(p for p in Path(folder).iterdir() if p.suffix.lower() in sources.SOURCES)
    if not everything:
        raise af.InvalidInput(f"{folder}: holds no mesh")
    names = [path.stem for path in everything]
    if twins := sorted({name for name in names if names.count(name) > 1}):
        raise af.InvalidInput(f"{folder}: {twins[0]} is there twice, with different extensions")
    return everything


def refuse(failed, count):
    """InvalidInput with the reasons if some of `count` failed."""
    if failed:
        raise af.InvalidInput(f"{len(failed)} of {count} failed: {'; '.join(failed)}")


def write_sheet(output, everything, suffix):
    """Writes sheet.html with all finished wraps, also of other shards, the worst first."""
    rows = []
    for path in everything:
        place = output / f"{path.stem}{suffix}"
        try:
            report = json.loads(place.with_suffix(".json").read_text(encoding="utf-8"))
            target = files.read_mesh(path) if files.is_mesh(path) else None
            figures = f"{off(report):.2%} of the target's size off; {'; '.join(report['notes'])}"
            wrapped = files.read_mesh(place)
            rows.append((off(report), contact_sheet.cell(path.name, figures.rstrip("; "), wrapped, target)))
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            continue  # not finished, or of another program
    rows.sort(key=lambda row: -row[0])
    page, place = contact_sheet.page([row for _, row in rows]), output / "sheet.html"
    if place.is_file() and place.read_bytes() == page.encode():
        return
    with Outputs() as outputs:
        outputs.check(place, (".html",), "--output")
        outputs.write(place, lambda path: path.write_bytes(page.encode()))


def off(report):
    return max(report["to_target_mean"], report["from_target_mean"])


def read_done(place, mark):
    """The report of an output if it was made with the same input and settings; else None."""
    try:
        found = json.loads(place.with_suffix(".json").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    made = place.is_file() and isinstance(found, dict) and found.get("made_with") == mark.hexdigest()
    return found if made else None


def wrap_one(place, mark, target, source, samples, options, args):
    with Outputs() as outputs:
        outputs.check(place, files.MESH_SUFFIXES, "--output")
        function = target()
        field = with_progress(
            place.stem, lambda task: af.wrap(samples, function, [], options, task=task), args.quiet
        )
        outputs.write(place, lambda path: source.write_moved(path, field))
        report = {**field.report.to_dict(), "made_with": mark.hexdigest()}
        outputs.write(
            place.with_suffix(".json"),
            lambda path: path.write_text(json_text(report, indent=2) + "\n", encoding="utf-8"),
        )
    return report
