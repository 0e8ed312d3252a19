"""The catalogue of robots: how to load them, their variants, their papers' closed forms."""

if __name__ != "closedchain.robots":
    raise ImportError("import closedchain.robots, not robots: two copies of a class never match")

from closedchain.robots.catalogue import Robot, families, family, load, robot, robots

__all__ = ["Robot", "families", "family", "load", "robot", "robots"]
