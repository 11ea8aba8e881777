"""Bodies that begin inside each other, as far as the scene alone shows it: blocks, which are boxes at rest."""

from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple

from softseam_protocol.scene.bodies import AnyBody, block_of
from softseam_protocol.scene.repeat import repeated
from softseam_protocol.scene.spec import Vector, wrong


class Overlap(NamedTuple):
    """Two blocks of which one begins inside the other."""

    one: str
    other: str
    """the later of the two"""
    depth: float
    """by which the other is to be moved for them to be clear [m]"""
    axis: int
    """along which that is least: 0, 1, 2"""
    sign: float
    """and which way"""


def box_of(body: AnyBody) -> tuple[Vector, Vector] | None:
    """Lower and upper corner of a block at rest [m]; None of other bodies."""
    found = block_of(body)
    if found is None:
        return None
    (x, y, z), (dx, dy, dz) = found.body.position, found.shape.size
    return (x - 0.5 * dx, y - 0.5 * dy, z), (x + 0.5 * dx, y + 0.5 * dy, z + dz)


def overlaps(bodies: Mapping[str, AnyBody]) -> Iterator[Overlap]:
    """Every two blocks that overlap by more than rounding, found by a sweep along x."""
    known = {name: box for name, body in bodies.items() if (box := box_of(body)) is not None}
    place = {name: number for number, name in enumerate(known)}
    open_: list[str] = []
    for name in sorted(known, key=lambda name: known[name][0]):
        low, high = known[name]
        open_ = [each for each in open_ if known[each][1][0] > low[0]]
        for each in open_:
            below, above = known[each]
            up = [above[k] - low[k] for k in range(3)]  # for the name to be moved by
            down = [high[k] - below[k] for k in range(3)]
            if min(*up, *down) <= 1e-6 * min(h - b for b, h in zip(low + below, high + above, strict=True)):
                continue
            depth, axis, sign = min((way[k], k, s) for way, s in ((up, 1.0), (down, -1.0)) for k in range(3))
            one, other = (each, name) if place[each] < place[name] else (name, each)
            yield Overlap(one, other, depth, axis, sign if other == name else -sign)
        open_.append(name)


def check_apart(bodies: Mapping[str, AnyBody], touching: Collection[frozenset[str]]) -> None:
    """Raise pydantic's error where blocks that touch begin inside each other: contact would throw them apart.

    touching  pairs that do
    """
    found = [each for each in overlaps(bodies) if frozenset((each.one, each.other)) in touching]
    if not found:
        return
    worst = max(found, key=lambda each: each.depth)
    along, others = "xyz"[worst.axis], f"; {len(found) - 1} more do so" if len(found) > 1 else ""
    of = repeated(worst.other)
    if of and of == repeated(worst.one):
        text = (
            f"{worst.one} and {worst.other} begin {1e3 * worst.depth:.3g} mm inside each other along {along}: give "
            f"copies {1e3 * worst.depth:.3g} mm more room there, or less shake and size{others}"
        )
        raise wrong(text, "bodies", of, "repeat")
    way = [0.0, 0.0, 0.0]
    way[worst.axis] = float(f"{worst.sign * worst.depth * (1.0 + 1e-3):.4g}")
    text = f"{worst.other} begins {1e3 * worst.depth:.3g} mm inside {worst.one}: move it by {way} m or more{others}"
    raise wrong(text, "bodies", of or worst.other, "position")
