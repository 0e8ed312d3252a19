"""Figures of maps and singular sets."""

from closedchain.analysis.figures.drawing import draw_map, draw_survey

__all__ = ["draw_map", "draw_survey"]
