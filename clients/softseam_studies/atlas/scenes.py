"""The atlas's scenes: a small block between smooth plates, whose force has a closed form, and its relatives."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from softseam_protocol.models import FAR_DEFAULT, NEAR_DEFAULT
from softseam_protocol.scene import marked_yaml

Model = str
FEM, XPBD, HYBRID = NEAR_DEFAULT, FAR_DEFAULT, "hybrid"
MODELS: dict[Model, str] = {FEM: "FEM", XPBD: "XPBD", HYBRID: "FEM and XPBD"}


def data_of(name: str) -> dict[str, Any]:
    """What a file of `maps/` says."""
    text = (Path(__file__).parent / "maps" / f"{name}.yaml").read_text(encoding="utf-8")
    found: dict[str, Any] = marked_yaml.parse(text).data
    return found


def scene_of(name: str, changes: Mapping[str, Any]) -> dict[str, Any]:
    """The scene of a file, changed by dotted keys."""
    scene: dict[str, Any] = data_of(name)["scene"]
    for key, value in changes.items():
        *parents, last = key.split(".")
        at = scene
        for parent in parents:
            at = at.setdefault(parent, {})
        at[last] = value
    return scene


_BODY = data_of("press")["scene"]["body"]
EDGE: float = _BODY["shape"]["size"][0]
"""of the cube [m]"""
POISSON: float = _BODY["material"]["poisson"]
YOUNG: float = _BODY["material"]["young"]
"""of the cube where nothing else is said [Pa]"""


def press(
    young: float,
    step: float,
    model: Model,
    *,
    squeeze: float = 0.1,
    speed: float = 0.01,
    hold: float = 0.1,
    friction: float = 0.0,
    poisson: float = POISSON,
    material: str = "neo_hookean",
    cells: int = 2,
    walls: bool = False,
    fem: Mapping[str, Any] | None = None,
    pbd: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """A cube between two plates that close by `squeeze` of its edge and hold; no gravity.

    walls  smooth ones keep the other four sides where they are
    speed  of each plate [m/s]
    hold   [s]
    cells  along an edge; with both models there are three along the squeeze, the middle one XPBD's
    """
    edge = EDGE / cells
    changes: dict[str, Any] = {f"tools.{name}.friction": friction for name in ("left", "right")}
    regions: dict[str, Any] = {"default": FEM if model == FEM else XPBD}
    if model == HYBRID:
        regions["near"] = {"model": FEM, "within": 0.2 * EDGE, "split": "always"}
    if walls:
        for axis, side in ((1, -1), (1, 1), (2, -1), (2, 1)):
            normal = [0.0, 0.0, 0.0]
            normal[axis] = -float(side)
            point = [-0.5 * EDGE * n for n in normal]
            changes[f"tools.wall{axis}{'ab'[side > 0]}"] = {"kind": "plane", "normal": normal, "point": point}
    time = max(step, round(0.5 * squeeze * EDGE / speed / step) * step)
    close = {"tools": ["left", "right"], "close": 0.5 * squeeze * EDGE / time, "until": {"time": time}}
    return scene_of(
        "press",
        changes
        | {f"body.material.{key}": value for key, value in (("kind", material), ("young", young), ("poisson", poisson))}
        | {
            "step": step,
            "body.cell": [EDGE / 3, edge, edge] if model == HYBRID else [edge, edge, edge],
            "motion": [close, {"hold": max(hold, 4 * step)}],
            "regions": regions,
            "models": {FEM: dict(fem or {}), XPBD: dict(pbd or {})},
        },
    )


def pressed(squeeze: float, poisson: float = POISSON) -> float:
    """F/(E A) of the neo-Hookean cube between smooth plates, A at rest: the same for every E [1].

    Stretch a along the force, b across: P = mu (a - b^2/a) and mu b + (lambda ln J - mu)/b = 0 with J = a b^2, the
    sides being free. mu/E = 1/(2 (1 + nu)), lambda/E = nu/((1 + nu)(1 - 2 nu)).
    """
    a = 1.0 - squeeze
    mu = 0.5 / (1.0 + poisson)
    lam = poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    b = a**-poisson
    for _ in range(60):
        r = mu * (b * b - 1.0) + lam * (np.log(a) + 2.0 * np.log(b))
        b -= r / (2.0 * mu * b + 2.0 * lam / b)
    return float(mu * (b * b / a - a))


def confined(squeeze: float, poisson: float = POISSON) -> float:
    """F/(E A) of the cube in a smooth box: P = mu (1/a - a) - lambda ln a / a, b = 1 [1]."""
    a = 1.0 - squeeze
    mu = 0.5 / (1.0 + poisson)
    lam = poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    return float(mu * (1.0 / a - a) - lam * np.log(a) / a)


def force_share(young: float) -> Any:
    """Measures F/(E A) of the grip."""
    area = EDGE * EDGE
    return lambda observation: observation.grip_force / (young * area)
