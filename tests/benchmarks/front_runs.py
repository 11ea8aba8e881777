"""The runs of `front`: a tray of cubes, one upon them that is gripped and lifted, in any cells, model and step."""

from __future__ import annotations

from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np
from cubes import EDGE, tray  # beside the tests

from softseam_protocol.models import facts_of
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.probes import Probes
from softseam_services.orchestrator.simulation import Simulation

LIMIT, TRIED = 600.0, 60.0
"""CPU seconds that a run may take; one of FEM alone, which is only tried"""
GRIPPED = "picked"
HELD = 3, 5
"""phases of the motion at whose ends force and stress are looked at: the cube is held, and is held in the air"""
CLOSES = 2
"""that in which fingers close"""
_MOTION = (
    "motion=[{{hold: 0.56}}, {{tools: [left, right], move: [0, 0, -0.004], speed: 0.1}}, "
    "{{tools: [left, right], close: 0.05, until: {{{until}}}}}, {{hold: 0.1}}, "
    "{{tools: [left, right], move: [0, 0, 0.02], speed: 0.2}}, {{hold: 0.1}}]"
)
_ROOM = 0.004
"""between a finger and the cube, at first [m]"""
_FINGER, _ABOVE = 0.06, 0.0005
"""height of the fingers, and how far above the cube's base they begin [m]; they end above its top. As the tray has
sagged they go down beside it, and cover its faces but for the lowest 3 mm: no other edge of theirs presses into one"""
_OFFSETS = 0.0125 * (np.arange(4) - 1.5)
"""of the lattice of points at which stress is looked at, from the cube's middle [m]"""


@dataclass(frozen=True)
class Material:
    """What the gripped cube is of, and by how much it is squeezed; the others are tofu of 20 kPa."""

    label: str
    young: float
    """[Pa]"""
    poisson: float
    squeeze: float
    """compression [1]"""

    @property
    def until(self) -> str:
        """When fingers have closed. Stiff cubes, squeezed by little, lie askew on the soft ones by some tenths of a
        degree, by which the width that is compressed would be another in each run: there the fingers' way counts."""
        if self.squeeze > 0.1:
            return f"compression: {self.squeeze}"
        return f"time: {(_ROOM + 0.5 * EDGE * self.squeeze) / 0.05!r}"


TOFU = Material("tofu, 20 kPa", 2e4, 0.45, 0.15)
CHEESE = Material("cheese, 1 MPa", 1e6, 0.4, 0.03)


@dataclass(frozen=True)
class Choice:
    """How a tray is simulated: the gripped cube in cells^3 of a model, the others in `beside`^3 cells."""

    material: Material
    model: str
    cells: int
    beside: int
    step: float = 0.005
    sleep: bool = True
    others: str = "pbd"
    """model of the others"""
    side: int = 3
    """cubes along each side of the tray"""

    @property
    def label(self) -> str:
        """In words."""
        name = {model: facts_of(model).label for model in (self.model, self.others)}
        same = self.model == self.others and self.cells == self.beside
        cells = f"{name[self.model]} {_cubed(self.cells)}"
        of = f"all {cells}" if same else f"{cells} among {name[self.others]} {_cubed(self.beside)}"
        return f"{of}, {1e3 * self.step:g} ms{'' if self.sleep else ', no sleep'}"


def _cubed(cells: int) -> str:
    return f"{cells}³" if cells > 1 else "1"


def scene_of(choice: Choice) -> Scene:
    """The shipped tray, as chosen, of a jelly that rests sooner than tofu, so that it rests before it is gripped."""
    of = choice.material
    settings = [
        f"bodies.cube.cell={EDGE / choice.beside!r}",
        f"bodies.cube.regions={{default: {choice.others}}}",
        f"bodies.{GRIPPED}.cell={EDGE / choice.cells!r}",
        f"bodies.{GRIPPED}.regions={{default: {choice.model}}}",
        f"bodies.{GRIPPED}.material.young={of.young!r}",
        f"bodies.{GRIPPED}.material.poisson={of.poisson!r}",
        *(f"bodies.{name}.material.retardation_time=0.01" for name in ("cube", GRIPPED)),
        *(f"tools.{name}.size=[0.016, 0.06, {_FINGER!r}]" for name in ("left", "right")),
        *(
            f"tools.{name}.position=[{x}, 0, {choice.side * 0.0504 + _FINGER / 2 + _ABOVE!r}]"
            for name, x in (("left", -0.037), ("right", 0.037))
        ),
        f"step={choice.step!r}",
        _MOTION.format(until=of.until),
    ]
    return tray(choice.side, *settings, *(["sleep=calm"] if choice.sleep else []))


def run(choice: Choice) -> dict[str, Any]:
    """Force (2,) [N] and von Mises stress (2, p) [Pa] as the cube is held on the tray, and in the air; CPU seconds a
    simulated second from when fingers close on, and how many bodies were awake then, in the mean. Of a run that takes
    more than `LIMIT` how far it came instead: `stopped`, in steps."""
    simulation = Simulation(bundle_scene(scene_of(choice)), EmbeddedTransport())
    body = simulation.bodies[GRIPPED].body
    assert isinstance(body, Body)
    points = Probes(body, lattice(body))
    held: dict[int, tuple[float, list[float]]] = {}
    seconds, steps, awake, phase, inside, total, all_steps = 0.0, 0, 0, 0, 0, 0.0, 0
    try:
        while not simulation.done:
            began = process_time()
            report = simulation.step()
            spent = process_time() - began
            total, all_steps = total + spent, all_steps + 1
            if total > (LIMIT if choice.others == "pbd" else TRIED):
                return {"stopped": all_steps, "expected": simulation.expected_steps, "spent": total}
            inside = inside + 1 if report.phase == phase else 1
            phase = report.phase
            if phase >= CLOSES:
                seconds, steps = seconds + spent, steps + 1
                awake += sum(part.iterations > 0 for part in report.parts.values())
            if phase in HELD and inside * choice.step > 0.06:  # the last look counts
                found = points.measure(simulation.frames()[GRIPPED], (choice.model, choice.model))
                stress = [value for name, value in found.items() if name.endswith("von_mises")]
                held[phase] = report.quantities[f"{GRIPPED}.grip_force"], stress
    finally:
        simulation.close()
    force, stresses = zip(*(held[at] for at in HELD), strict=True)
    return {"force": force, "stress": stresses, "seconds": seconds / (steps * choice.step), "awake": awake / steps}


def lattice(body: Body) -> dict[str, tuple[float, float, float]]:
    """Points at which stress in a cube is looked at, by name [m]."""
    middle = 0.5 * (body.x_rest.min(axis=0) + body.x_rest.max(axis=0))
    places = (middle + np.array([x, y, z]) for x in _OFFSETS for y in _OFFSETS for z in _OFFSETS)
    return {f"at{n}": (float(x), float(y), float(z)) for n, (x, y, z) in enumerate(places)}
