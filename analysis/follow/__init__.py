"""Tasks over time for mechanisms with more freedoms than the task needs."""

from closedchain.analysis.follow.comparison import Comparison, ComparisonRow, compare
from closedchain.analysis.follow.following import follow
from closedchain.analysis.follow.result import Follow
from closedchain.analysis.follow.task_path import TaskPath, read_task_path, task_path

__all__ = [
    "Comparison",
    "ComparisonRow",
    "Follow",
    "TaskPath",
    "compare",
    "follow",
    "read_task_path",
    "task_path",
]
