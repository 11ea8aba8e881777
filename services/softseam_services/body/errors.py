"""What can be wrong with a body's shape."""

from __future__ import annotations


class MeshError(ValueError):
    """A shape that cannot be simulated. The text names the file, the counts, the worst element and the remedy."""
