"""A progress bar for long work, on a terminal only."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from closedchain.closure.progress import Progress


@contextmanager
def reporting(progress: bool | Progress) -> Iterator[Progress | None]:
    """Give what long work calls with (what, done, total): a bar, the caller's own, or nothing.

    A call with total 0 says what is going on without a measure of it. The bar shows what is done,
    its rate and, with the rate so far, the time left.
    """
    if callable(progress):
        yield progress
        return
    if not progress:
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[count]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=console, transient=True) as bar:
        tasks: dict[str, TaskID] = {}

        def report(what: str, done: int, total: int) -> None:
            whole = total or None
            if what not in tasks:
                tasks[what] = bar.add_task(what, total=whole, completed=done, count="")
            task = bar.tasks[tasks[what]]
            rate = f", {task.speed:,.0f}/s" if task.speed else ""
            count = f"{done:,} of {total:,}{rate}" if total else ""
            bar.update(tasks[what], completed=done, total=whole, count=count)

        yield report
