"""How pieces differ from one episode to the next: domain randomisation.

A piece is drawn by the environment's seed and the number of its episode, always with as many numbers, so that what one
spread is changes nothing of what the others draw.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam.errors import BadInput, SceneRefused
from softseam_protocol.scene.bodies import BlockShape, BodySpec, MeshShape, block_of
from softseam_protocol.scene.friction_field import LARGEST_SPREAD, FrictionFieldSpec
from softseam_protocol.scene.scene import Scene

OF_A_BLOCK = 0.9
"""part of a block that a shear wave may go through in a substep of XPBD: by 0.83 pieces at rest stay whole, by 1.0 they
come apart (`tests/unit/test_batch_env.py`)"""


@dataclass(frozen=True)
class Drawn:
    """What one piece differs in."""

    young: float
    """[Pa]"""
    density: float
    """[kg/m^3]"""
    poisson: float
    size: tuple[float, float, float] | None
    """of a block [m]; None where it is the scene's"""
    scale: float
    """of a mesh, in parts of the scene's; 1 of a block"""
    friction: dict[str, float]
    """of the tools, by name"""
    friction_field: FrictionFieldSpec | None
    """how friction varies over its surface; None where it does not"""
    turn: float
    """of the tools that grip, about the vertical [rad]"""
    offset: tuple[float, float]
    """of them, along x and y [m]"""

    def place(self, position: Sequence[float]) -> tuple[float, float, float]:
        """Where a tool that grips begins whose place is this one without turn and offset [m]."""
        x, y, z = position
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        return cos * x - sin * y + self.offset[0], sin * x + cos * y + self.offset[1], z


@dataclass(frozen=True)
class Randomise:
    """Spreads: 0.3 is up to 30 % less or more than what the scene says, evenly; 0 is as it says."""

    young: float = 0.3
    density: float = 0.3
    friction: float = 0.3
    """of the tools that grip, alike, and of each of the others"""
    friction_field: float = 0.0
    """standard deviation of the factor on friction over a piece's surface, `spread` of its `body.friction_field`, whose
    seed is the piece's own; 0 is as the scene says"""
    friction_length: tuple[float, float] = (0.015, 0.04)
    """least and greatest `length` of that field [m]"""
    size: float = 0.3
    """of each edge of a block; of a mesh, of all of it alike"""
    poisson: tuple[float, float] = (0.315, 0.4725)
    """least and greatest"""
    yaw: float = 9.0
    """turn of the tools that grip about the vertical, to either side [degrees]"""
    offset: float = 3e-3
    """of the tools that grip from the body's middle, along x and y, to either side [m]"""

    def __post_init__(self) -> None:
        """Raises BadInput where a spread leaves nothing that can be simulated."""
        for name in ("young", "density", "friction", "size"):
            if not 0.0 <= (spread := getattr(self, name)) < 1.0:
                raise BadInput(f"{name}={spread!r}: give a part of what the scene says, from 0 to below 1")
        if not 0.0 <= self.friction_field <= LARGEST_SPREAD:
            raise BadInput(
                f"friction_field={self.friction_field!r}: give the standard deviation of a factor whose mean is 1, "
                f"from 0 to {LARGEST_SPREAD:g}"
            )
        if not 0.0 < self.friction_length[0] <= self.friction_length[1] < math.inf:
            raise BadInput(
                f"friction_length={self.friction_length!r}: give the least and the greatest [m], more than 0"
            )
        low, high = self.poisson
        if not -1.0 < low <= high < 0.5:
            raise BadInput(f"poisson={self.poisson!r}: give the least and the greatest, between -1 and 0.5")
        if not 0.0 <= self.yaw <= 45.0:
            raise BadInput(f"yaw={self.yaw!r}: give degrees, from 0 to 45")
        if not 0.0 <= self.offset < math.inf:
            raise BadInput(f"offset={self.offset!r}: give metres, 0 or more")

    @classmethod
    def nothing(cls, scene: Scene) -> Randomise:
        """Every episode as the scene is."""
        materials = scene.body.cell_materials
        poisson = materials[0].poisson if materials else 0.0
        none: dict[str, Any] = {f.name: 0.0 for f in fields(cls) if isinstance(f.default, float)}
        return cls(**none, poisson=(poisson, poisson))

    def check_substep(self, scene: Scene, substep: float) -> None:
        """Raises BadInput where XPBD cannot step the hardest piece that may be drawn of a scene of a block in cells.

        In a substep [s] a shear wave must not go through more than 0.9 of a block.
        """
        block = block_of(scene.body)
        if block is None or not block.body.wanted_edges:
            return
        body, shape = block
        lines = zip(shape.size, body.wanted_edges, strict=True)
        edge = min(size / max(round(size / cell), 1) for size, cell in lines)
        modulus = body.material.young * (1.0 + self.young) / (2.0 * (1.0 + self.poisson[0]))
        speed = math.sqrt(modulus / (body.material.density * (1.0 - self.density)))
        most = OF_A_BLOCK * edge * (1.0 - self.size) / speed
        if substep > most:
            raise BadInput(
                f"substeps of {1e3 * substep:g} ms are too long for the stiffest, lightest and smallest "
                f"piece that may be drawn, of Young's modulus {body.material.young * (1.0 + self.young):.4g} Pa: it "
                f"bears {1e3 * most:.2g} ms. Vary young, density and size by less, or make body.material.young less or "
                "body.cell larger; model='fem' takes any"
            )

    def draw(self, scene: Scene, pads: Sequence[str], random: np.random.Generator) -> Drawn:
        """One piece of a scene of a block or a mesh, between pads."""
        others = [name for name in scene.tools if name not in pads]
        part = random.uniform(-1.0, 1.0, 10 + len(others))  # of each spread
        body = _in_cells(scene)
        low, high = self.poisson
        friction = {}
        for name, each in [*((pad, part[6]) for pad in pads), *zip(others, part[10:], strict=True)]:
            friction[name] = scene.tools[name].friction * (1.0 + self.friction * each)
        size = None
        if isinstance(body.shape, BlockShape) and self.size > 0.0:
            x, y, z = (edge * (1.0 + self.size * each) for edge, each in zip(body.shape.size, part[3:6], strict=True))
            size = (x, y, z)
        scale = 1.0 if isinstance(body.shape, BlockShape) else 1.0 + self.size * part[3]
        return Drawn(
            young=body.material.young * (1.0 + self.young * part[0]),
            density=body.material.density * (1.0 + self.density * part[1]),
            poisson=0.5 * (low + high + part[2] * (high - low)),
            size=size,
            scale=scale,
            friction=friction,
            friction_field=self._field(body, part),
            turn=math.radians(self.yaw) * part[7],
            offset=(self.offset * part[8], self.offset * part[9]),
        )

    def _field(self, body: BodySpec, part: NDArray[np.float64]) -> FrictionFieldSpec | None:
        """By numbers of its own, which follow from those that were drawn for the piece."""
        if self.friction_field == 0.0:
            return body.friction_field
        random = np.random.default_rng(part.view(np.uint64))
        length, seed = float(random.uniform(*self.friction_length)), int(random.integers(2**31))
        return FrictionFieldSpec(spread=self.friction_field, length=length, seed=seed)

    def settings(self, scene: Scene, pads: Sequence[str], random: np.random.Generator) -> tuple[str, ...]:
        """Of one piece, as `softseam run --set` takes them."""
        drawn, body = self.draw(scene, pads, random), _in_cells(scene)
        found = [
            f"body.material.young={drawn.young:.6g}",
            f"body.material.density={drawn.density:.6g}",
            f"body.material.poisson={drawn.poisson:.6g}",
        ]
        if isinstance(body.shape, BlockShape) and drawn.size is not None:
            found.append(f"body.shape.size={_list(drawn.size)}")
            if isinstance(body.cell, tuple):
                ratio = zip(body.cell, drawn.size, body.shape.size, strict=True)
                found.append(f"body.cell={_list([cell * new / old for cell, new, old in ratio])}")
        if isinstance(body.shape, MeshShape) and drawn.scale != 1.0:
            if body.shape.scale is None:
                raise SceneRefused(
                    f"body.shape.scale: sizes are drawn about it: give metres per unit of {body.shape.path}, e.g. "
                    "scale: 0.001"
                )
            found.append(f"body.shape.scale={body.shape.scale * drawn.scale:.9g}")
            if body.cell is not None:
                cell = (body.cell,) * 3 if isinstance(body.cell, float) else body.cell
                found.append(f"body.cell={_list([edge * drawn.scale for edge in cell])}")
        found += [f"tools.{name}.friction={value:.6g}" for name, value in drawn.friction.items()]
        if self.friction_field > 0.0 and drawn.friction_field is not None:
            found.append(f"body.friction_field={drawn.friction_field.model_dump_json()}")
        for pad in pads:
            at = drawn.place(scene.tools[pad].position)  # type: ignore[union-attr]
            found += [f"tools.{pad}.position={_list(at)}", f"tools.{pad}.rotation={_list((0.0, 0.0, drawn.turn))}"]
        return tuple(found)


def _in_cells(scene: Scene) -> BodySpec:
    """The only body of a scene, which has cells."""
    body = scene.body.in_cells
    assert body is not None
    return body


def _list(numbers: Sequence[float]) -> str:
    return f"[{', '.join(f'{number:.9g}' for number in numbers)}]"
