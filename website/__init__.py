"""The documentation site: pages gathered from the repository, reference and gallery made anew."""
