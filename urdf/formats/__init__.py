"""Other ways to write a mechanism down: each module reads one format, writes it, or both."""
