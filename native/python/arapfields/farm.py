# SPDX-License-Identifier: GPL-3.0-or-later
"""Many meshes on the workers of a Dask cluster, for scripts that call the library: docs/guide/farms.md.

    from distributed import Client
    outcomes = farm.map(stylized, sorted(Path("meshes").glob("*.ply")), Client("tcp://head:8786"))

Where tasks run, and again after a worker's end, is Dask's affair. What is added: one mesh that fails stops no
other, and the outcomes are in order.
"""

import asyncio
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from ._native import InvalidInput

if TYPE_CHECKING:
    from distributed import Client

Item = TypeVar("Item")
Value = TypeVar("Value")


@dataclass(frozen=True)
class Outcome(Generic[Item, Value]):
    """What became of an item: the function's `value`, or the `error` that it ended with."""

    item: Item
    value: Value | None = None
    error: BaseException | None = None

    @property
    def done(self) -> bool:
        return self.error is None


def map(
    function: Callable[[Item], Value],
    items: Iterable[Item],
    client: "Client",
    *,
    retries: int = 0,
    on_done: Callable[[Outcome[Item, Value]], object] | None = None,
) -> list[Outcome[Item, Value]]:
    """function(item) for each item, on the client's workers: an Outcome each, in the items' order.

    The function and the items travel to the workers: meshes had better be names of files that all can read,
    and the function one that writes its file whole. Items at work on a worker that dies, and values that die
    with it, are done by another, up to the scheduler's `allowed-failures` (3) deaths. What raises is tried
    `retries` times again; what is wrong with a mesh is wrong each time, hence 0. `on_done` gets each
    outcome as it arrives. An interruption cancels what has not begun. InvalidInput where `client` is no
    Client of `distributed`, ImportError where that is missing.
    """
    try:
        from distributed import Client, as_completed
        from distributed.protocol.pickle import dumps
    except ImportError:
        raise ImportError("farm.map needs the package distributed: pip install 'arapfields[farm]'") from None
    if not isinstance(client, Client) or client.asynchronous:
        raise InvalidInput(
            f"client: got {type(client).__name__}; a distributed.Client, not asynchronous, is needed"
        )
    if not callable(function):
        raise InvalidInput(f"function: got {type(function).__name__}; a function of one item is needed")
    if not isinstance(retries, int) or not 0 <= retries <= 1000:
        raise InvalidInput(f"retries: got {retries!r:.40}; an integer from 0 to 1000 is needed")
    try:
        dumps(function)
    except Exception as error:
        raise InvalidInput(
            f"function: cannot travel to the workers ({str(error).splitlines()[0]})"
        ) from error
    there = list(items)
    futures: dict[Any, int] = {}
    outcomes: dict[int, Outcome[Item, Value]] = {}
    try:
        for number, item in enumerate(there):
            futures[client.submit(function, item, pure=False, retries=retries)] = number
        for future in as_completed(list(futures)):
            number = futures[future]
            outcomes[number] = _outcome(there[number], future)
            future.release()
            if on_done is not None:
                on_done(outcomes[number])
    finally:
        client.cancel([future for future, number in futures.items() if number not in outcomes])
    return [outcomes[number] for number in range(len(there))]


def _outcome(item: Item, future: Any) -> Outcome[Item, Any]:
    """Waits once more where the value was lost with its worker and is computed again."""
    try:
        return Outcome(item, value=future.result())
    except (Exception, asyncio.CancelledError) as error:
        return Outcome(item, error=error)
