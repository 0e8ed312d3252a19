"""MJCF, the format of MuJoCo: read by MuJoCo itself, written as plain text."""
