"""Tasks over time for mechanisms with more freedoms than the task needs."""

from closedchain.analysis.motion.follow.comparison import Comparison, ComparisonRow, compare
from closedchain.analysis.motion.follow.following import follow
from closedchain.analysis.motion.follow.result import Follow
from closedchain.analysis.motion.follow.task_path import TaskPath, read_task_path, task_path

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
