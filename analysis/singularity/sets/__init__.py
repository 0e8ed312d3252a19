"""Singular sets: points, curves and surfaces where a kind of singularity holds."""
