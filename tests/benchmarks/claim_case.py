"""How a scene that claims are held against the truth on is written: bodies, tools and motions in short."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from benchmarks.claim_shapes import obj

from softseam_protocol.scene.file import scene_from_document
from softseam_protocol.scene.scene import Scene

Document = dict[str, Any]
FEM: Document = {"default": "fem"}
XPBD: Document = {"default": "pbd"}
GROUND: Document = {"kind": "plane", "point": [0, 0, 0], "normal": [0, 0, 1], "friction": 0.5}


@dataclass(frozen=True)
class Case:
    """A scene, and what is compared."""

    scene: Scene
    files: dict[str, bytes]
    told: str
    """what happens, for people"""
    kind: str
    """'mesh', 'slips' or 'block'; a mesh that slips is both: 'mesh, slips'"""
    truth: int
    """how many times shorter the truth's cells are"""


def material(young: float, poisson: float = 0.45, kind: str = "neo_hookean", **more: float) -> Document:
    return {"kind": kind, "young": young, "poisson": poisson, "density": 1050, **more}


def block(size: list[float], cell: float | list[float], of: Document, **more: Any) -> Document:
    return {"shape": {"kind": "block", "size": size}, "cell": cell, "material": of, **more}


def mesh(name: str, cell: float, of: Document, **more: Any) -> Document:
    shape = {"kind": "mesh", "path": f"{name}.obj", "scale": 0.001}
    return {"shape": shape, "cell": cell, "material": of, **more}


def plates(low: list[float], high: list[float], axis: int = 0, gap: float = 5e-4, **more: Any) -> Document:
    """Two boxes beside a body that reaches from `low` to `high`, wider than it."""
    found = {}
    for name, sign, face in (("left", -1, low[axis]), ("right", 1, high[axis])):
        size = [end - start + 0.01 for start, end in zip(low, high, strict=True)]
        middle = [0.5 * (start + end) for start, end in zip(low, high, strict=True)]
        size[axis], middle[axis] = 0.01, face + sign * (0.005 + gap)
        found[name] = {"kind": "box", "size": size, "position": middle, "friction": 0.6, **more}
    return found


def around(size: list[float], axis: int = 0, **more: Any) -> Document:
    return plates([-0.5 * size[0], -0.5 * size[1], 0.0], [0.5 * size[0], 0.5 * size[1], size[2]], axis, **more)


def closing(speed: float = 0.02, hold: float = 0.1, **until: float) -> list[Document]:
    return [{"tools": ["left", "right"], "close": speed, "until": until}, {"hold": hold}]


def held(force: float, time: float, lift: float = 0.0) -> list[Document]:
    """A grip of kept force, and a lift."""
    grip = [{"tools": ["left", "right"], "close": 0.02, "force": force, "until": {"time": time}}]
    return grip + ([{"tools": ["left", "right"], "move": [0, 0, lift], "speed": 0.05}] if lift else [])


def scene(
    told: str,
    body: Document,
    tools: Document,
    quantities: list[str],
    *,
    motion: list[Document] | None = None,
    duration: float | None = None,
    step: float = 0.01,
    gravity: list[float] | None = None,
    regions: Document = FEM,
    probes: Document | None = None,
    slips: bool = False,
    truth: int = 2,
    **more: Any,
) -> Case:
    document: Document = {
        "softseam": 1,
        "name": "".join(c if c.isalnum() else "_" for c in told)[:64],
        "gravity": gravity or [0, 0, 0],
        "step": step,
        "duration": duration,
        "body": body,
        "tools": tools,
        "motion": motion or [],
        "regions": regions,
        "quantities": quantities,
        "probes": probes or {},
        **more,
    }
    shape = body["shape"]
    is_mesh = shape["kind"] == "mesh"
    files = {shape["path"]: obj(shape["path"].removesuffix(".obj"))} if is_mesh else {}
    kind = ", ".join(["mesh" if is_mesh else "block", *(["slips"] if slips else [])])
    return Case(scene_from_document(document, told), files, told, kind, truth)


DOWN = [0, 0, -9.81]
MIDDLE = {"middle": [0, 0, 0.015]}
CUBE = [0.04, 0.04, 0.04]
