"""Islands: what interfaces join, directly or by others, and nothing else: bodies that step in one loop."""

from collections.abc import Iterable

__all__ = ["islands_of"]


def islands_of(names: Iterable[str], joined: Iterable[tuple[str, str]]) -> list[tuple[str, ...]]:
    """Names that pairs join, each in one island; islands and what is in them in the order of the names.

    Each name points at an earlier one of its island, or at itself (Tarjan, J. ACM 22, 1975, 215-225). Raises KeyError
    for a pair with a name that is not there.
    """
    first = {name: name for name in names}

    def root(name: str) -> str:
        while first[name] != name:
            first[name] = first[first[name]]
            name = first[name]
        return name

    order = {name: place for place, name in enumerate(first)}
    for a, b in joined:
        one, other = sorted((root(a), root(b)), key=order.__getitem__)
        first[other] = one
    found: dict[str, list[str]] = {}
    for name in first:
        found.setdefault(root(name), []).append(name)
    return [tuple(island) for island in found.values()]
