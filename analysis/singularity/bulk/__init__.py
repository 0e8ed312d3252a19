"""The measures of many postures in machine code: ``bulk_measures``."""
