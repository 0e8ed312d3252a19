"""A progress bar for long work, on a terminal only."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from closedchain.analysis.walk import Progress


@contextmanager
def reporting(progress: bool | Progress) -> Iterator[Progress | None]:
    """Give what long work calls with (what, done, total): a bar, the caller's own, or nothing."""
    if callable(progress):
        yield progress
        return
    if not progress:
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, TaskID, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed}/{task.total} ({task.fields[rate]}/s)"),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=console, transient=True) as bar:
        tasks: dict[str, TaskID] = {}

        def report(what: str, done: int, total: int) -> None:
            if what not in tasks:
                tasks[what] = bar.add_task(what, total=total, rate="-")
            task = bar.tasks[tasks[what]]
            rate = f"{task.speed:.0f}" if task.speed else "-"
            bar.update(tasks[what], completed=done, total=total, rate=rate)

        yield report
