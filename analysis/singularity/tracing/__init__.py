"""Tracing one-dimensional solution sets by continuation, through branch points."""
