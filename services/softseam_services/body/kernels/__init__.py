"""Loops over cells, triangles and surface points of the body."""
