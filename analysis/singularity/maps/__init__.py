"""Maps of the singularity measures over grids of coordinates, in tiles, on one branch."""
