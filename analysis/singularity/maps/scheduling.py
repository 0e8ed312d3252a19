"""Who works on the tiles: threads of this process, or the workers of a Dask client."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Executor,
    Future,
    ThreadPoolExecutor,
    wait,
)
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from closedchain.analysis.singularity.maps.spreading import Job, Task, work
from closedchain.analysis.singularity.maps.tiles import Found, Index
from closedchain.urdf.errors import ClosureError

_PATIENCE = 0.2  # seconds between looks at the progress of tiles that are being worked on


@dataclass(frozen=True, eq=False)
class Crew:
    """Workers on the tiles of one map.

    ``job`` is the Job, or what stands for it at the workers; ``lost`` are the errors that say that
    workers are gone.
    """

    executor: Executor
    job: Any
    workers: int
    lost: tuple[type[BaseException], ...] = ()

    def run(
        self, tasks: Iterator[Task], waiting: Callable[[int], None]
    ) -> Generator[tuple[Index, Found], None, None]:
        """Yield what is found, in whatever order tiles get done.

        ``waiting`` is called often, with the number of cells done in tiles that are not. Tasks
        are taken as workers get free, so that few of them are in memory.

        Raises
        ------
        ClosureError
            The workers are gone.
        """
        pending: dict[Future[Found], Task] = {}
        try:
            more = True
            while more or pending:
                while more and len(pending) < 2 * self.workers:
                    task = next(tasks, None)
                    if task is None:
                        more = False
                        break
                    with self._still_there():
                        pending[self.executor.submit(work, self.job, task)] = task
                done, _ = wait(pending, timeout=_PATIENCE, return_when=FIRST_COMPLETED)
                for future in done:
                    with self._still_there():
                        found = future.result()
                    yield pending.pop(future).tile, found
                waiting(sum(int(task.signals.done[0]) for task in pending.values()))
        finally:
            for future, task in pending.items():
                task.signals.stop[0] = 1
                future.cancel()

    @contextmanager
    def _still_there(self) -> Iterator[None]:
        try:
            yield
        except self.lost as error:
            why = f"{type(error).__name__}{f': {error}' if str(error) else ''}"
            raise ClosureError(
                "the Dask workers of the map are gone, killed or cut off from their scheduler "
                f"({why}); what they had found is in the store of a map that is saved, and the "
                "same call goes on from there"
            ) from error


@contextmanager
def crew(job: Job, workers: Any = None, client: Any = None) -> Iterator[Crew]:
    """Workers for a map: ``workers`` threads, or those of a Dask client given as either argument.

    Raises
    ------
    ClosureError
        ``workers`` is neither a positive number nor a Dask client.
    """
    if client is not None and workers is not None:
        raise ClosureError("give either workers or client, not both")
    if client is None and hasattr(workers, "get_executor"):
        client = workers
    if client is not None:
        if not hasattr(client, "get_executor"):
            raise ClosureError(f"client must be a dask.distributed.Client, got {client!r}")
        threads = max(1, sum(client.nthreads().values()))
        with client.get_executor(pure=False) as executor:
            scattered = client.scatter(job, broadcast=True, hash=False)
            yield Crew(executor, scattered, threads, _dask_losses())
        return
    count = default_workers() if workers is None else workers
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise ClosureError(f"workers must be a positive number or a Dask client, got {workers!r}")
    executor = ThreadPoolExecutor(count, thread_name_prefix="closedchain-map")
    try:
        yield Crew(executor, job, count)
    finally:
        executor.shutdown(cancel_futures=True)


def _dask_losses() -> tuple[type[BaseException], ...]:
    from distributed import KilledWorker
    from distributed.client import ClosedClientError
    from distributed.comm.core import CommClosedError

    return CancelledError, KilledWorker, CommClosedError, ClosedClientError


def default_workers() -> int:
    """One for each core that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
