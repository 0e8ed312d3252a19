"""A mechanism as a program of its own, in C or JavaScript: ``export_code``."""
