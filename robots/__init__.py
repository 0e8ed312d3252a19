"""The catalogue of robots: how to load them, their variants, their papers' closed forms."""

if __name__ != "closedchain.robots":
    raise ImportError("import closedchain.robots, not robots: two copies of a class never match")

from closedchain.robots.catalogue import families, family, groups, load, robot, robots
from closedchain.robots.entry import Robot

__all__ = ["Robot", "families", "family", "groups", "load", "robot", "robots"]
