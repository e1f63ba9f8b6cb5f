# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of fields and distances as dicts, independently of the library, point caches, and full disks."""

import contextlib
import json
import struct
from itertools import pairwise
from pathlib import Path

import numpy as np

import arapfields as af
from arapfields.point_cache import PointCacheWriter

# Files of fields and signed distances as dicts, independently of the library, and small point caches.

DTYPES = {"F64": np.dtype("<f8"), "F32": np.dtype("<f4")}
NAMES = {dtype: name for name, dtype in DTYPES.items()}


def read(path):
    """(texts, arrays): __metadata__ with parsed structure and report, and {name: array}."""
    content = Path(path).read_bytes()
    (length,) = struct.unpack("<Q", content[:8])
    header, data = json.loads(content[8 : 8 + length]), content[8 + length :]
    texts = header.pop("__metadata__")
    for name in ("structure", "report"):
        texts[name] = json.loads(texts[name])
    arrays = {}
    for name, entry in header.items():
        begin, end = entry["data_offsets"]
        arrays[name] = np.frombuffer(data[begin:end], DTYPES[entry["dtype"]]).reshape(entry["shape"])
    return texts, arrays


def header_of(texts, arrays):
    """The header as a dict, arrays in the dict's order. All versions become version 1, without checksum."""
    texts = {k: v if isinstance(v, str) else json.dumps(v) for k, v in texts.items() if k != "checksum"}
    if texts.get("version") in ("2", "3", "4"):
        texts["version"] = "1"
    header, offset = {"__metadata__": texts}, 0
    for name, array in arrays.items():
        end = offset + array.nbytes
        header[name] = {
            "dtype": NAMES[array.dtype],
            "shape": list(array.shape),
            "data_offsets": [offset, end],
        }
        offset = end
    return header


def joined(header, data):
    """The content of a file: header (a dict, or raw bytes) and the arrays' bytes."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + data


def packed(texts, arrays):
    return joined(header_of(texts, arrays), b"".join(array.tobytes() for array in arrays.values()))


def make_examples(folder):
    """{name: path} of small files, one for each kind and each optional part."""
    rng = np.random.default_rng(0)
    folder = Path(folder)
    sizes = [12, 8, 8, 1]
    layers = [rng.normal(size=(b, a)) / a**0.5 for a, b in pairwise(sizes)]
    sdf = af.NeuralSdf.from_layers(layers, [np.zeros(b) for b in sizes[1:]], octaves=2)
    turns = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    legs = np.concatenate([[[np.cos(t), np.sin(t), z] for t in turns] for z in np.linspace(-3, 3, 30)])
    normals = legs * [1, 1, 0]
    both = np.concatenate([legs * [0.2, 0.2, 1] + [0.3, 0, 0], legs * [0.2, 0.2, 1] - [0.3, 0, 0]])
    samples = af.SurfaceSamples(both, np.concatenate([normals, normals]))
    rest = np.diag([1.0, 1.0, 0.5, 1.0])
    rest[2, 3] = -3.0
    above = rest.copy()
    above[2, 3] = 3.0
    target = above.copy()
    target[0, 3] = 0.5
    handles = [af.Cuboid(rest, rest), af.Cuboid(above, target)]
    small = {"iterations": 3, "batch": 20, "width": 8, "layers": 1, "octaves": 2, "threads": 1}
    ends = both * [1.2, 1.0, 1.1]
    onto = af.MeshSdf(ends, np.arange(len(ends) - 3)[:, None] + [0, 1, 2])
    flow = af.WrapOptions(centers=20, stages=2, iterations=1, alignment="rigid", threads=1)
    live = {"samples": 200, "coarse_centers": 8, "fine_centers": 20, "iterations": 3, "threads": 1}
    examples = {
        "sdf": sdf,
        "neural": af.deform(samples, handles, af.DeformOptions(**small)),
        "exact": af.deform(samples, handles, af.DeformOptions(exact_handles=True, **small)),
        "refined": af.deform(samples, handles, af.DeformOptions(start="radial", centers=20, **small)),
        "invertible": af.deform(samples, handles, af.DeformOptions(field="invertible", couplings=3, **small)),
        "radial": af.LiveDeformer(samples, handles, af.LiveOptions(interior=False, **live)).solve(),
        "composed": af.wrap(samples, onto, options=flow),
        "embedded": af.LiveDeformer(samples, handles, af.LiveOptions(interior=True, **live)).solve(),
    }
    for name, thing in examples.items():
        thing.save(folder / f"{name}.safetensors")
    return {name: folder / f"{name}.safetensors" for name in examples}


def load(path):
    """Loads a file by the class for its name."""
    kind = af.NeuralSdf if Path(path).name.startswith("sdf") else af.DeformationField
    return kind.load(path)


POINTS, FRAMES = 7, 5  # of a point cache


def random_motion():
    """(FRAMES, POINTS, 3) random positions."""
    return np.random.default_rng(0).normal(size=(FRAMES, POINTS, 3)).astype(np.float32)


def write_cache(path, motion, **settings):
    with PointCacheWriter(path, motion.shape[1], len(motion), **settings) as cache:
        for positions in motion:
            cache.write(positions)
    return path


def names(folder):
    return sorted(path.name for path in folder.iterdir())


# Simulates a full disk by the system's limit on file sizes.


@contextlib.contextmanager
def files_of_at_most(size):
    """Limits files of this process to `size` bytes; None: no limit."""
    if size is None:
        yield
        return
    import resource  # not on Windows

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
