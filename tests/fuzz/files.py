# SPDX-License-Identifier: GPL-3.0-or-later
"""A fuzz target for each kind of file: valid examples, how to damage them, and their readers."""

import json
from pathlib import Path

import numpy as np
from support.files import archives, odd_meshes

import arapfields as af
from addon.commands.batch import Record, differences, read_objects
from arapfields.__main__ import main
from arapfields.cli import files
from arapfields.cli.handles import build_handles, read_handles
from arapfields.cli.meshes import formats

from . import mutate
from .calls import SPLATS_GIVEN

POINTS = np.random.default_rng(1).uniform(-1, 1, (5, 3))
FEW = POINTS[:2]


class Target:
    """{name: example file}, `damage(rng, name)` → bytes; `use(path)` may raise only documented errors."""

    documented = (af.InvalidInput, OSError)

    def __init__(self, folder):
        self.folder = Path(folder)
        self.examples = self.make()
        self.contents = {name: path.read_bytes() for name, path in self.examples.items()}

    def case(self, rng):
        """Writes a damaged file to the folder."""
        name = sorted(self.examples)[rng.integers(len(self.examples))]
        path = self.folder / f"case-{self.examples[name].name}"
        path.write_bytes(self.damage(rng, name))
        return path

    def damage(self, rng, name):
        if rng.integers(3):
            return mutate.mutate_text(rng, self.contents[name])
        return mutate.mutate_bytes(rng, self.contents[name])


class Archives(Target):
    def make(self):
        examples = archives.make_examples(self.folder)
        self.parts = {name: archives.read(path) for name, path in examples.items()}
        return {name: path for name, path in examples.items() if (name == "sdf") == self.sdf}

    def damage(self, rng, name):
        return mutate.mutate_archive(rng, self.contents[name], *self.parts[name])


class Fields(Archives):
    """Saved deformation fields: loaded, evaluated with their derivatives, inverted, saved again."""

    sdf = False

    def use(self, path):
        field = af.DeformationField.load(path)
        field(POINTS), field.jacobian(POINTS), field.hessian(FEW)
        field.inverse(FEW)
        field.save(self.folder / "again")


class Sdfs(Archives):
    """Saved signed distances."""

    sdf = True

    def use(self, path):
        sdf = af.NeuralSdf.load(path)
        sdf(POINTS), sdf.gradient(POINTS), repr(sdf)
        sdf.save(self.folder / "again")


class Meshes(Target):
    """Meshes: read, moved and written in their own format and in another by the command line's functions."""

    def make(self):
        examples = {}
        for name, (content, _) in odd_meshes.all_files().items():
            examples[name] = self.folder / name
            examples[name].write_bytes(content)
        return examples

    def use(self, path):
        mesh = files.read_any(path)
        move = mesh.vertices + 1.0
        formats.write_moved(self.folder / f"moved{path.suffix}", path.suffix, mesh, move)
        other = {".obj": ".ply", ".ply": ".off", ".off": ".stl", ".stl": ".obj"}[path.suffix]
        formats.write_moved(self.folder / f"other{other}", path.suffix, mesh, move)
        again = formats.read(self.folder / f"moved{path.suffix}")
        assert np.array_equal(again.sizes, mesh.sizes) or path.suffix == ".stl"  # more corners may be equal
        files.read_surface(path)


class Splats(Target):
    """Files of Gaussian splats."""

    def make(self):
        path = self.folder / "splats.ply"
        af.GaussianSplats(*[rows[:12] for rows in SPLATS_GIVEN]).save(path)
        return {"splats": path}

    def use(self, path):
        af.GaussianSplats.is_file(path)
        splats = af.GaussianSplats.load(path)
        assert len(splats.scales) == len(splats.opacities) == len(splats.harmonics)
        splats.save(self.folder / "again.ply")


class Handles(Target):
    """Handles as JSON."""

    def make(self):
        one = {"type": "cuboid", "corners": [[None, -1, 0], [1, None, 2.5]], "weight": 2}
        one["move"] = {
            "rotate": {"axis": [0, 0, 1], "degrees": 30},
            "pivot": [0, 0, 0],
            "translate": [1, 0, 0],
        }
        two = {
            "type": "cuboid",
            "center": [0, 0, 0],
            "half_extents": [1, 2, 3],
            "rotation": np.eye(3).tolist(),
        }
        three = {"type": "cuboid", "rest": np.eye(4).tolist(), "target": np.eye(4).tolist()}
        point = {"type": "point", "rest": [0, 0, 0], "target": [1, 1, 1], "weight": 0.5}
        self.value = {"handles": [one, two, three, point]}
        path = self.folder / "pose.json"
        path.write_text(json.dumps(self.value))
        return {"pose": path}

    def damage(self, rng, name):
        if rng.integers(4) == 0:
            return mutate.mutate_bytes(rng, self.contents[name])
        return mutate.dumped(rng, mutate.mutate_json(rng, self.value))

    def use(self, path):
        build_handles(read_handles(path), np.array([[-1.0] * 3, [1.0] * 3]))


class Normals(Target):
    """Preferred normals as text or arrays."""

    def make(self):
        rows = np.eye(3)
        np.savetxt(self.folder / "rows.txt", rows)
        np.savetxt(self.folder / "rows.csv", rows, delimiter=",")
        np.save(self.folder / "rows.npy", rows)
        return {path.name: path for path in self.folder.glob("rows.*")}

    def use(self, path):
        files.read_normals(path)


class Records(Target):
    """Records of batches, and reports of their children."""

    def make(self):
        entry = {"status": "done", "message": "x", "options": "0", "source": [1, 2], "output": "a.ply"}
        self.values = {
            "record": {"format": 2, "input": "a.ply", **entry, "seconds": 1.0, "objects": []},
            "batch": {"format": 2, "settings": {"version": "1", "verb": "stylize", "strength": 0.5}},
            "report": {
                "input": "a",
                "objects": [{"object": "a", "status": "done", "message": "x", "figures": {}}],
            },
        }
        for name, value in self.values.items():
            (self.folder / f"{name}.json").write_text(json.dumps(value))
        return {name: self.folder / f"{name}.json" for name in self.values}

    damage = Handles.damage

    @property
    def value(self):
        return self.values["record"]

    def use(self, path):
        record = Record(self.folder)
        record.folder.mkdir(exist_ok=True)
        for place in (record.place("a.ply"), record.place("batch").with_name("batch.json")):
            place.write_bytes(path.read_bytes())
        record.is_done("a.ply", path, path, "0")
        differences(record.settings() or {}, {"version": "1"})
        read_objects(path)


class CommandLine(Target):
    """The command line on damaged fields, meshes and handles: ends with an exit code, without a traceback."""

    def make(self):
        self.parts = [kind(self.sub(kind.__name__)) for kind in (Fields, Sdfs, Meshes, Handles)]
        (self.folder / "mesh.obj").write_bytes((self.folder / "Meshes" / "texture.obj").read_bytes())
        return {"mesh": self.folder / "mesh.obj"}

    def sub(self, name):
        (self.folder / name).mkdir()
        return self.folder / name

    def case(self, rng):
        return self.parts[rng.integers(len(self.parts))].case(rng)

    def use(self, path):
        mesh, out = str(self.folder / "mesh.obj"), str(self.folder / "out.obj")
        arguments = {
            ".json": [
                "deform",
                mesh,
                "-o",
                out,
                "--handles",
                str(path),
                "--iterations",
                "1",
                "--samples",
                "50",
            ],
            ".safetensors": ["warp", str(path), mesh, "-o", out],
        }.get(path.suffix, ["grid", str(path), "-o", str(self.folder / "g.npz"), "--resolution", "2"])
        code = main([*arguments, *(["--width", "8"] if path.suffix == ".json" else []), "--quiet"])
        assert code in (0, 1, 2), code


TARGETS = {
    kind.__name__.lower(): kind
    for kind in (Fields, Sdfs, Meshes, Splats, Handles, Normals, Records, CommandLine)
}
