"""Bodies of one scene that nothing keeps apart: they pass through one another.

What begins inside another, or above it, will: that is a warning. Of others a check says it, too, and a run when it sees
two where one is.
"""

from collections.abc import Iterator, Mapping
from itertools import combinations

from softseam_protocol.models import facts_of, that
from softseam_protocol.scene.apart import box_of
from softseam_protocol.scene.bodies import AnyBody
from softseam_protocol.scene.interfaces import ContactsSpec, no_surface
from softseam_protocol.scene.repeat import repeated
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.spec import Vector

Box = tuple[Vector, Vector]


_FEW = 3
"""bodies that touch, none of which is in a pile: their rows are solved at once, which takes .4 s a step of four"""


def look(scene: Scene) -> Iterator[str]:
    yield from _said(scene, likely=True)
    models = {name: scene.of(name).regions.default for name in scene.bodies if scene.is_joined(name)}
    slow = [model for model in models.values() if model is not None and not facts_of(model).piles]
    if isinstance(scene.contacts, ContactsSpec) and _FEW < len(slow) == len(models):
        yield (
            f"contacts: {len(slow)} bodies of {slow[0]} may touch, whose contacts are solved all at once: that is slow "
            f"beyond {_FEW}; give bodies that can do without to {' or '.join(that(lambda facts: facts.piles))}"
        )


def note(scene: Scene) -> Iterator[str]:
    return _said(scene, likely=False)


def _said(scene: Scene, likely: bool) -> Iterator[str]:
    """Sentences about bodies of which some will meet, or of which none needs to."""
    if scene.contacts == "none":
        return
    why = {name: no_surface(body, scene.regions) for name, body in scene.bodies.items()}
    joined = {frozenset(each.between) for each in scene.interfaces.values()}
    free = [pair for pair in combinations(scene.bodies, 2) if frozenset(pair) not in joined]
    boxes = {name: _about(body) for name, body in scene.bodies.items()}
    meet = {pair for pair in free if _will_meet(boxes, pair, scene.gravity)}
    able = [pair for pair in free if not (why[pair[0]] or why[pair[1]])]
    if able and bool(meet.intersection(able)) == likely:
        one, other = next((pair for pair in able if pair in meet), able[0])
        more = f", nor {len(able) - 1} other pairs" if len(able) > 1 else ""
        yield (
            f"bodies: nothing keeps {one} and {other} apart{more}: bodies pass through one another; add contacts: "
            "{friction: 0.5}, or contacts: none where they are meant to"
        )
    for group in dict.fromkeys(repeated(name) or name for name, text in why.items() if text):
        own = [pair for pair in free if any(group in (name, repeated(name)) for name in pair)]
        if own and bool(meet.intersection(own)) == likely:
            pair = next((pair for pair in own if pair in meet), own[0])
            name, other = pair if group in (pair[0], repeated(pair[0])) else (pair[1], pair[0])
            yield (
                f"bodies.{group}: nothing but tools touches it yet, {why[name]}: it passes through {other} and all "
                "others; keep it away from them, or say contacts: none where it is meant to"
            )


def _about(body: AnyBody) -> Box | None:
    """Lower and upper corner of a box around a body at rest [m]; None where only its file says how large it is."""
    if box_of(body) is not None or not body.own_lengths:
        return box_of(body)
    (x, y, z), half = body.said("position", (0.0, 0.0, 0.0)), 0.5 * max(body.own_lengths)
    return (x - half, y - half, z - half), (x + half, y + half, z + half)


def _will_meet(boxes: Mapping[str, Box | None], pair: tuple[str, str], gravity: Vector) -> bool:
    """Whether one of two bodies begins in the other, or above it as gravity goes, or next to that."""
    one, other = boxes[pair[0]], boxes[pair[1]]
    if one is None or other is None:
        return False
    down = max(range(3), key=lambda axis: abs(gravity[axis])) if any(gravity) else None
    return all(axis == down or (one[0][axis] < other[1][axis] and other[0][axis] < one[1][axis]) for axis in range(3))
