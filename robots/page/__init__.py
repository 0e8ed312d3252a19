"""Scripts and styles of the pages, as files."""
