"""The survey of a mechanism: maps and singular sets of several slices, and their files."""

from closedchain.analysis.survey.surveying import Survey, survey

__all__ = ["Survey", "survey"]
