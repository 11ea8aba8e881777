"""Runs beside a scene's sweep that a plan was foretold to need, kept as what they are for plans of other tolerances.

What a plan of 10 % ran may be what one of 5 % wants, and was not foretold to be as good as it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from softseam.study.configurations import Configuration, Fem
from softseam.study.foretold import Run
from softseam.study.frame import Frame
from softseam.study.measure import Outcome
from softseam.study.store import Store
from softseam_protocol.scene.spec import Vector

_PREFIX = "beside-"


def keep(store: Store, configuration: Configuration) -> None:
    """Note what a run of FEM alone is, whose outcome the store is to hold under its key."""
    fem = configuration.fem
    if fem is not None:
        data: dict[str, Any] = {name: getattr(fem, name) for name in ("step", "element", "integrator", "grading")}
        data |= {"counts": list(fem.counts), "towards": list(fem.towards), "follows": fem.frame.follows}
        store.write(_PREFIX + configuration.key, data | {"settings": list(configuration.settings)})


def kept(store: Store, frame: Frame) -> Iterator[Run]:
    """What was noted and ran to its end; what another version noted is left out. Raises BadInput as `Store.read`."""
    for name in store.names(_PREFIX):
        data, outcome = store.read(name), store.read(name.removeprefix(_PREFIX))
        if data is None or outcome is None:
            continue  # interrupted between the two
        try:
            one, ran = _fem(data, frame).configuration(), Outcome.from_json(outcome)
            is_known = _PREFIX + one.key == name and list(one.settings) == data["settings"]
        except (KeyError, TypeError, ValueError):
            continue
        if is_known and ran.status == "done":
            yield one, ran


def _fem(data: dict[str, Any], frame: Frame) -> Fem:
    x, y, z = map(int, data["counts"])
    grading = data["grading"]
    return Fem(
        replace(frame, follows=bool(data["follows"])),
        (x, y, z),
        float(data["step"]),
        str(data["element"]),
        str(data["integrator"]),
        _vector(grading) if isinstance(grading, list) else float(grading),
        tuple(map(str, data["towards"])),
    )


def _vector(data: list[Any]) -> Vector:
    x, y, z = map(float, data)
    return x, y, z
