"""Bodies that come to be where others are are named once: at once where nothing keeps them apart, late where contact
does."""

from __future__ import annotations

from typing import Any

import numpy as np
from cubes import EDGE, cube, scene_of

from softseam_services.orchestrator.overlaps import Overlaps

BODIES = {f"cube{k}": cube(0, 1, position=[0.0, 0.0, 1.1 * EDGE * k]) for k in range(3)}
CONTACT = {"kind": "contact", "between": ["cube0", "cube1"]}


def watched(middles: list[float], **keys: Any) -> list[str]:
    """What is said of cubes with their middles at these heights, in edges, looked at twice."""
    said: list[str] = []
    watch = Overlaps(scene_of(BODIES, **keys), lambda kind, text: said.append(f"{kind}: {text}"))
    half = np.full(3, 0.5 * EDGE)
    at = np.array([[0.0, 0.0, EDGE * height] for height in middles])
    for step in (9, 19):
        watch.look(step, np.stack((at - half, at + half), axis=1))
    return said


def test_free_bodies_are_named_once_together() -> None:
    assert watched([0.5, 1.4, 2.5]) == []
    (only,) = watched([0.5, 0.9, 1.3])
    assert only.startswith(
        "overlap: step 9: cube0 and cube1, the first of 2 pairs, are where the other is: nothing keeps"
    )


def test_bodies_that_came_through_their_contact_are_named_otherwise() -> None:
    (only,) = watched([0.5, 0.9, 2.5], interfaces={"touch": CONTACT})
    assert only.startswith("overlap: step 9: cube0 and cube1 are") and "came through their contact" in only
    assert watched([0.5, 1.2, 2.5], contacts={"friction": 0.4}) == []
    assert len(watched([0.5, 0.9, 1.3], contacts={"friction": 0.4})) == 1


def test_who_is_meant_to_pass_is_not_named() -> None:
    assert watched([0.5, 0.9, 1.3], contacts="none") == []
    (only,) = watched([0.5, 0.9, 1.3], contacts="none", interfaces={"touch": CONTACT})
    assert "pairs" not in only and "came through" in only
