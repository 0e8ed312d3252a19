"""Solvers: problems, Newton, paths, curves, and how they end."""
