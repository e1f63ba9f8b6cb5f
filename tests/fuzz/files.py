# SPDX-License-Identifier: GPL-3.0-or-later
"""Mutations of files: bytes, lines and numbers of texts, nodes of JSON, headers and arrays of archives.

Mutations of the structure keep lengths and offsets consistent, to pass the first checks."""

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

from .calls import SPLATS_GIVEN

NUMBERS = [0, 1, -1, 2, 7, 64, 255, 65536, 2**31 - 1, 2**31, 2**32, 2**53, 2**63, 2**64, 10**30, -(2**31)]
FLOATS = [0.5, -0.0, 1e-320, 1e-160, 1e160, 1.7e308, float("nan"), float("inf"), -float("inf")]
ODD = [None, True, False, "", "x", "\u0000", "\ud800", "é" * 40, [], {}, [[]], [1, 2, 3], {"a": 1}]
TOKENS = [
    "0",
    "-1",
    "1",
    "3",
    "nan",
    "inf",
    "-inf",
    "1e999",
    "1e-320",
    "2147483648",
    "99999999999999999999",
    "x",
    "",
    "\\",
]
TOKENS += ["1/1", "1//1", "-1/-1", "1/", "\x00", "4294967296", "0x10", "1,2", "\u00e9", "1_000"]


def odd_value(rng):
    """Any JSON value."""
    kind = rng.integers(4)
    if kind == 0:
        return NUMBERS[rng.integers(len(NUMBERS))]
    if kind == 1:
        return FLOATS[rng.integers(len(FLOATS))]
    return ODD[rng.integers(len(ODD))]


def mutate_bytes(rng, content):
    """Replaces, removes, doubles or truncates bytes."""
    data = bytearray(content)
    for _ in range(1 + int(rng.integers(4))):
        at = int(rng.integers(len(data) + 1))
        length = int(rng.integers(1, 16))
        kind = rng.integers(6)
        if kind == 0:
            del data[at if rng.integers(3) else int(rng.integers(12)) :]
        elif kind == 1:
            data[at : at + length] = rng.bytes(length)
        elif kind == 2:
            del data[at : at + length]
        elif kind == 3:
            data[at:at] = data[at : at + 20 * length]
        elif kind == 4 and at < len(data):
            data[at] ^= 1 << int(rng.integers(8))
        else:
            data[at:at] = rng.bytes(length)
    return bytes(data)


def mutate_text(rng, content):
    """Replaces, removes, doubles or joins words and lines of a text."""
    lines = content.decode("latin-1").split("\n")
    for _ in range(1 + int(rng.integers(4))):
        at = int(rng.integers(len(lines)))
        kind = rng.integers(7)
        if kind == 0:
            del lines[at]
        elif kind == 1:
            lines[at:at] = [lines[at]] * int(rng.integers(1, 50))
        elif kind == 2:
            lines[at] += " \\" if rng.integers(2) else "\r"
        elif kind == 3:
            lines = lines[: at + 1]
        else:
            words = lines[at].split(" ")
            words[rng.integers(len(words))] = TOKENS[rng.integers(len(TOKENS))]
            lines[at] = " ".join(words)
        lines = lines or [""]
    return "\n".join(lines).encode("latin-1", errors="replace")


def nodes(value, path=()):
    """All paths of a JSON value."""
    yield path
    if isinstance(value, dict | list):
        for key in value if isinstance(value, dict) else range(len(value)):
            yield from nodes(value[key], (*path, key))


def mutate_json(rng, value):
    """A copy with one node replaced, removed, renamed, doubled or nested."""
    value = json.loads(json.dumps(value))
    places = list(nodes(value))
    path = places[rng.integers(len(places))]
    if not path:
        return odd_value(rng)
    parent = value
    for key in path[:-1]:
        parent = parent[key]
    key, kind = path[-1], rng.integers(6)
    if kind == 0:
        del parent[key]
    elif kind == 1 and isinstance(parent, dict):
        parent[str(odd_value(rng))] = parent.pop(key)
    elif kind == 2:
        for _ in range(int(rng.integers(1, 60))):
            parent[key] = [parent[key]]
    elif kind == 3 and isinstance(parent, list):
        parent += [parent[key]] * int(rng.integers(1, 5))
    elif kind == 4 and isinstance(parent[key], int | float) and not isinstance(parent[key], bool):
        parent[key] = [parent[key] + 1, parent[key] - 1, -parent[key], parent[key] * 2**20][rng.integers(4)]
    else:
        parent[key] = odd_value(rng)
    return value


def dumped(rng, value):
    text = json.dumps(value).encode()
    if rng.integers(10) == 0:  # a duplicate member
        text = text.replace(b"{", b'{"a": 1, "a": 2, ' if rng.integers(2) else b'{"width": 3, ', 1)
    if rng.integers(20) == 0:
        text = b"[" * int(rng.integers(100000)) + text
    return text


def mutate_array(rng, array):
    array = array.copy()
    kind = rng.integers(6)
    if kind == 0 and array.ndim:
        return np.ascontiguousarray(array[: rng.integers(len(array) + 1)])
    if kind == 1 and array.ndim:
        return np.concatenate([array, array[: rng.integers(len(array) + 1)]])
    if kind == 2:
        return np.ascontiguousarray(array.T)
    if kind == 3:
        return array.reshape(-1)
    if kind == 4:
        return array.astype("<f4" if array.dtype == "<f8" else "<f8")
    if array.size:
        values = np.array([*FLOATS, 0, -1, 1e9], array.dtype)
        flat = array.reshape(-1)
        flat[rng.integers(array.size, size=1 + rng.integers(4))] = values[rng.integers(len(values))]
    return array


def mutate_archive(rng, content, texts, arrays):
    """A saved file with one part changed; `texts` and `arrays`: those of the valid file."""
    kind = rng.integers(5)
    with np.errstate(all="ignore"):
        if kind == 0:
            return mutate_bytes(rng, content)
        if kind == 1:  # the header, with its correct length
            header = mutate_json(rng, archives.header_of(texts, arrays))
            return archives.joined(dumped(rng, header), b"".join(a.tobytes() for a in arrays.values()))
        if kind == 2:  # the metadata
            return archives.packed({**texts, "structure": mutate_json(rng, texts["structure"])}, arrays)
        if kind == 3:
            name = ("format", "version", "kind", "structure", "report")[rng.integers(5)]
            text = dumped(rng, odd_value(rng)).decode() if rng.integers(2) else str(odd_value(rng))
            return archives.packed({**texts, name: text}, arrays)
        changed = dict(arrays)
        name = list(arrays)[rng.integers(len(arrays))]
        if rng.integers(8) == 0:
            changed[str(odd_value(rng))] = changed.pop(name)
        else:
            changed[name] = mutate_array(rng, arrays[name])
        return archives.packed(texts, changed)


# A fuzz target for each kind of file: valid examples, how to damage them, and their readers.

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
            return mutate_text(rng, self.contents[name])
        return mutate_bytes(rng, self.contents[name])


class Archives(Target):
    def make(self):
        examples = archives.make_examples(self.folder)
        self.parts = {name: archives.read(path) for name, path in examples.items()}
        return {name: path for name, path in examples.items() if (name == "sdf") == self.sdf}

    def damage(self, rng, name):
        return mutate_archive(rng, self.contents[name], *self.parts[name])


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
            return mutate_bytes(rng, self.contents[name])
        return dumped(rng, mutate_json(rng, self.value))

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
