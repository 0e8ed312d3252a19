"""Topological structure: loops, open chains in order, position and orientation characteristics."""
