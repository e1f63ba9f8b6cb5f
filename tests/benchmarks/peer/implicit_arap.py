# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs dbaieri/implicit-arap by its own trainer: implicit_arap.py CHECKOUT PROBLEM.npz RESULT.npz [options]

PROBLEM holds vertices (n,3), static (s,3), moving and goals (m,3), and the signed distance's network:
weights_i, biases_i, encoding (octaves, frequency, sharpness). RESULT gets the vertices moved. Settings are
those of its command deform-sdf; the options say what is less. What it draws, logs and reads meshes with are
stand-ins.
"""

import argparse
import contextlib
import dataclasses
import sys
import tempfile
import time
import types
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import torch

ABSENT = ("kaolin", "kaolin.rep", "vedo", "mcubes", "wandb", "tyro", "tyro.conf", "tyro.extras", "trimesh")
ABSENT += ("polyscope", "polyscope.imgui", "jaxtyping")


def hashable(dataclass):
    """`dataclass`, whose classes of theirs can be hashed: Python 3.11 takes no others as defaults."""

    def decorate(kind=None, /, **given):
        if kind is None:
            return lambda kind: decorate(kind, **given)
        more = {"unsafe_hash": True} if kind.__module__.startswith("iarap.") else {}
        return dataclass(kind, **{**given, **more})

    return decorate


def import_it(checkout):
    """Its modules."""
    for name in ABSENT:
        sys.modules[name] = MagicMock()
    sys.modules["kaolin.rep"] = types.SimpleNamespace(SurfaceMesh=object)
    dataclasses.dataclass = hashable(dataclasses.dataclass)
    sys.path.insert(0, str(checkout))
    import iarap.config.defaults as defaults
    import iarap.model.base_sdf as base
    import iarap.train.trainer as trainer

    if Path(defaults.__file__).resolve().parents[2] != Path(checkout).resolve():
        sys.exit(f"{checkout} holds no implicit-arap: {defaults.__file__} was found")
    return defaults, base, trainer


def distance_network(problem, base):
    """The signed distance that we deform, as a shape model of theirs."""
    octaves, frequency, sharpness = problem["encoding"]
    count = sum(name.startswith("weights_") for name in problem)

    class Distance(base.SDF):
        def __init__(self):
            super().__init__(3)
            shapes = [problem[f"weights_{i}"].shape for i in range(count)]
            self.layers = torch.nn.ModuleList(torch.nn.Linear(columns, rows) for rows, columns in shapes)
            self.act = torch.nn.Softplus(beta=float(sharpness))
            for i, layer in enumerate(self.layers):
                layer.weight.data = torch.tensor(problem[f"weights_{i}"], dtype=torch.float32)
                layer.bias.data = torch.tensor(problem[f"biases_{i}"], dtype=torch.float32).reshape(-1)

        def distance(self, x):
            angles = x.unsqueeze(-1) * (float(frequency) * 2.0 ** torch.arange(int(octaves)))
            h = torch.stack([torch.cos(angles), torch.sin(angles)], -1).flatten(-3)
            for layer in self.layers[:-1]:
                h = self.act(layer(h))
            return self.layers[-1](h)

        def forward(self, x_in, with_grad=False, differentiable_grad=False):
            x = x_in.requires_grad_() if with_grad else x_in
            found = {"dist": self.distance(x)}
            if with_grad:
                found["grad"] = self.gradient(x, found["dist"], differentiable_grad)
            return found

    return Distance()


class Spent(Exception):
    """The time is."""


class Log:
    """Where its trainer logs to: the losses by step. Ends the training when the time is over."""

    def __init__(self, folder, minutes):
        self.dir, self.losses, self.begin = str(folder), [], time.process_time()
        self.end = self.begin + 60 * minutes if minutes else float("inf")

    def log(self, losses):
        self.losses.append([float(loss) for loss in losses.values()])
        if time.process_time() > self.end:
            raise Spent
        if len(self.losses) % 25 == 1:
            took = time.process_time() - self.begin
            print(f"step {len(self.losses)} after {took:.0f} s: {self.losses[-1]}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ("checkout", "problem", "result"):
        parser.add_argument(name, type=Path)
    parser.add_argument("--steps", type=int, help="else its own")
    parser.add_argument("--patches", type=int, nargs=2, help="on the surface and in space; else its own")
    parser.add_argument("--minutes", type=float, help="of the processor, after which it is stopped")
    given = parser.parse_args()
    torch.set_num_threads(1)  # threads that wait for one another would count as its work
    problem = dict(np.load(given.problem))
    defaults, base, trainer = import_it(given.checkout)
    with tempfile.TemporaryDirectory() as folder:
        folder, shape = Path(folder), distance_network(problem, base)
        torch.save(shape.state_dict(), folder / "shape.pt")
        for kind, names in (("parts", ("static", "moving")), ("transforms", ("goals",))):
            (folder / kind).mkdir()
            for name in names:
                np.savetxt(folder / kind / f"{name}.txt", problem[name])
        spec = "handles:\n  static:\n    positions: [static]\n"
        spec += "  moving:\n    positions: [moving]\n    transform: [goals]\n"
        (folder / "handles.yaml").write_text(spec)
        settings = {"pretrained_shape": folder / "shape.pt", "handles_spec": folder / "handles.yaml"}
        settings |= {"device": "cpu", "shape_model": types.SimpleNamespace(setup=lambda: shape)}
        if given.steps:
            settings["num_steps"] = given.steps
        if given.patches:
            settings |= dict(zip(("zero_samples", "space_samples"), given.patches, strict=True))
        log = Log(folder, given.minutes)
        trainer.wandb.init = lambda **_: log
        own = defaults.deform_sdf_entrypoint
        config = dataclasses.replace(own, **settings)
        config.to_dict = dict
        type(config).__str__ = lambda _: ""
        begin, work = time.perf_counter(), time.process_time()
        run = config.setup()
        with contextlib.suppress(Spent):
            run.run()
        took = time.perf_counter() - begin, time.process_time() - work
    vertices = torch.tensor(problem["vertices"], dtype=torch.float32)
    with torch.no_grad():
        moved = torch.cat([run.model.deform(part) for part in vertices.split(20000)]).double().numpy()
    np.savez(
        given.result,
        moved=moved,
        seconds=took,
        losses=log.losses,
        steps=len(log.losses),
        patches=[config.zero_samples, config.space_samples],
        own_steps=own.num_steps,
        own_patches=[own.zero_samples, own.space_samples],
    )


if __name__ == "__main__":
    main()
