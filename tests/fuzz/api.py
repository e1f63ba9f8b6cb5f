# SPDX-License-Identifier: GPL-3.0-or-later
"""Calls of the public interface with some invalid arguments, which must return a result or raise a documented
error."""

import types

import arapfields as af

from .calls import ROWS, calls, odd, splat_calls

LEFT_OUT = {  # {public callable that is not fuzzed: reason}
    "ImplicitFunction": "a base for Python: tests/python/test_implicit_function.py",
    "ImplicitFunction.__call__": "likewise: classes of ours have their own",
    "ImplicitFunction.gradient": "likewise: classes of ours have their own",
    "Energy.__call__": "a base for Python: tests/python/test_external_energies.py",
    "cmake_dir": "a path of the installation, without arguments",
    "skin_weights": "seconds a call: tests/python/test_skin.py",
    "skin_correctives": "seconds a call: tests/python/test_skin.py",
    "Corrective.value": "of what skin_correctives returns",
    "RadialField.arrays": "without arguments: tests/python/test_fields.py",
    "LiveDeformer.reset": "without arguments; it would undo what other calls have set up",
    "PointCacheReader.close": "without arguments, after a reader that the file of each case gives",
}


def public_callables():
    """Names of all functions, constructible classes and members of the package."""
    for name, value in vars(af).items():
        if not callable(value):
            continue
        if name.startswith("_") or isinstance(value, types.ModuleType) or hasattr(value, "__origin__"):
            continue
        if not isinstance(value, type):
            yield name
        elif value.__name__ == name and not is_plain(value):
            if "No constructor" not in initializer(value) and "Initialize self" not in initializer(value):
                yield name
            yield from (f"{name}.{member}" for member in called_members(value))


def is_plain(cls):
    """Whether a class is an error or plain data."""
    return issubclass(cls, BaseException | tuple) or hasattr(cls, "__dataclass_fields__")


def initializer(cls):
    return cls.__init__.__doc__ or ""


def called_members(cls):
    for name, member in vars(cls).items():
        is_public = name == "__call__" or not name.startswith("_")
        if is_public and not isinstance(member, property) and callable(getattr(cls, name)):
            yield name


def unbound(rng):
    """A method of a class, called on an object that is no valid instance."""
    native = [v for v in vars(af._native).values() if isinstance(v, type)]
    chosen = rng.choice([v for v in native if not issubclass(v, BaseException)])
    called = ("__call__", "__len__", "__repr__", "__eq__")
    names = [n for n in dir(chosen) if not n.startswith("__") or n in called]
    names = [n for n in names if n != "report"]  # raises AttributeError if there is none
    member = getattr(chosen, names[rng.integers(len(names))])
    return getattr(member, "fget", member), [chosen.__new__(chosen), *[ROWS] * int(rng.integers(2))]


def case(rng, things):
    """(name, function, arguments) of a call with up to three invalid arguments."""
    known = calls(rng, things) | splat_calls(things) | {"unbound": lambda: unbound(rng)}
    name = sorted(known)[rng.integers(len(known))]
    function, arguments = known[name]()
    for _ in range(int(rng.integers(4))):
        if arguments:
            arguments[rng.integers(len(arguments))] = odd(rng, things)
    return name, function, arguments
