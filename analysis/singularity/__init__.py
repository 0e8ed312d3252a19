"""Where a mechanism is singular: kinds, classification of postures, maps and sets."""
