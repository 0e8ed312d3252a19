"""Motions along a path: tracking, tasks with redundancy, self-motion."""
