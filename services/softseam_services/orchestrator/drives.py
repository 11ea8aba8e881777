"""What drives tools that press with a force: their speed gives way where the body resists.

Each step the drive of a tool (or of the two tools of a grip, which are linked and stay centred) picks the speed v of
the coming step. With the mass m, the speed v_0 and the resistance f_0 of the step before, the stiffness k with which
the body is expected to resist more, and a damping c that keeps m from swinging on k,
  m (v - v_0)/dt = u - f,   f = f_0 + k dt v,   u = F - c v,   c = 2 sqrt(k m)                                    (1)
  v = (m v_0/dt + F - f_0)/(m/dt + c + k dt), and no more than the speed asked for.                             (2)
It is implicit in the resistance: while k is more than half of the true stiffness it is stable, and at rest f_0 = F
whatever k is. Free tools (f_0 = 0) have c = k = 0. k begins as what the whole cross-section A = volume/width of the
body can resist with, at once and at rest: k_0 = rho c_p A/dt + 2 (lambda + 2 mu) A/width; then it follows the ratio of
the last changes of force and way, where these tell something, falling by no more than a fifth a step, and rising to no
more than twice of it.

The resistance is known a step late, and in steps shorter than a wave takes through a cell most of it is the inertia of
the nodes that the tool pushes: a lighter tool would be thrown to and fro with ever more force (added mass: Causin,
Gerbeau and Nobile, Comput. Methods Appl. Mech. Engrg. 194 (2005) 4506). So m in (1) and (2) is the tool's own mass m_t
and m_a, and c = 2 sqrt(k m_t) + c_a,
  m_a = rho A h (1 - c_p dt/h)/4,   c_a = (k_s m_a)^(1/2),   k_s = 2 (lambda + 2 mu) A/width,                      (3)
h the length of the body's cells along the way: of a layer of them these nodes have a sixth. c_a is half of what is
critical on the body at rest; k, of which k_0 has a wave's impedance over a step, would damp more the shorter the step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.motion import ClosePhase, MovePhase, OpenPhase, TurnPhase
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.tools import PlaneTool, ToolSpec
from softseam_services.body.body import ALIKE, Body, Material
from softseam_services.body.build import AnyBody
from softseam_services.body.interpolate import bounding_points
from softseam_services.orchestrator.grip import AT_REST, nearest_body
from softseam_services.orchestrator.grips import Grips
from softseam_services.orchestrator.program import Progress

Floats = NDArray[np.float64]

SPEED, STIFFNESS, RESISTANCE, WAY, LARGEST, RELEASED = range(6)
"""columns of the state: [m/s], [N/m], resistance [N], way of the last step [m], resistance to the tool that feels most
[N]; a force is held on average, so where one is, the third is the tools' mean, else it is the fifth; 1 where the force
is held no more"""
_FALL, _RISE = 0.8, 2.0
"""of the stiffness expected, in a step: a small way beside a large change of force may be the body's own doing"""
_LEAST = 0.02
"""of k_0: below it a resistance that does not grow is not believed"""
_MOST = 4.0
"""of k_0: points that stick after a reversal resist with up to three times what they do in the long run"""
_ADDED = 0.25
"""of the mass of a layer of cells, at most, for a tool to be heavier than the nodes that it pushes [1]"""
_TOLD = 0.01
"""changes of the resistance below this part of it tell nothing of k"""


@dataclass(frozen=True, slots=True)
class Drive:
    """One degree of freedom: a tool along its move, or two tools along the line between them."""

    phase: int
    """that began it"""
    tools: tuple[int, ...]
    way: Floats | None
    """unit vector of a move (3,); None of a grip"""
    asked: float
    """speed that is asked for after the phase [m/s]"""
    force: float
    """held, or inf where only a limit is [N]"""
    limit: float
    """[N], or inf"""
    mass: float
    """of one tool [kg]"""
    added: float
    """m_a of eq. (3) [kg]"""
    added_damping: float
    """c_a [N s/m]"""
    stiffness: float
    """k_0 [N/m]"""


class Drives:
    """All drives of a scene's motion and their state, one row a drive."""

    def __init__(self, scene: Scene, bodies: Sequence[AnyBody], grips: Grips) -> None:
        self._dt, self._grips, self._motion = scene.step, grips, scene.motion
        self._index = {name: i for i, name in enumerate(scene.tools)}
        self.drives = _drives(scene, bodies, grips)
        """one of a closing phase, or of a tool that moves by itself up to its limit"""
        self._last = _last_phases(scene, self.drives)
        self.phases = {
            number for drive, last in zip(self.drives, self._last, strict=True) for number in range(drive.phase, last)
        }
        """in which a drive has its say"""
        self.state = np.zeros((len(self.drives), 6))
        self.short = np.zeros((len(self._index), 3))
        """way in the phase at hand from which a limit kept each tool, with its sign (t, 3) [m]"""
        self._chosen, self._kept = np.zeros(len(self.drives)), np.zeros((len(self._index), 3))
        self.reset()

    def reset(self) -> None:
        self.state[:], self.short[:] = 0.0, 0.0
        self.state[:, STIFFNESS] = [drive.stiffness for drive in self.drives]

    def apply(self, command: Floats, progress: Progress, orientation: Floats) -> None:
        """Let the drives at work in this phase have their say: command (t, 6) [m/s, rad/s] updated in place."""
        if not self.drives:
            return
        self._kept[:] = 0.0
        for row, drive in enumerate(self.drives):
            if not drive.phase <= progress.phase < self._last[row]:
                self._chosen[row] = 0.0
                continue
            ways, tools = self._ways(drive, orientation), list(drive.tools)
            asked, own = drive.asked, drive.phase == progress.phase
            if own:
                asked = float(command[tools[0], :3] @ ways[0])
            elif self.state[row, RELEASED] or self._moves_apart(drive, progress.phase, command[tools, :3], ways):
                self.state[row, RELEASED], asked = 1.0, 0.0
            speed = self._speed(row, drive, asked)
            self._chosen[row] = speed
            change = (speed - (asked if own else 0.0)) * ways
            command[tools, :3] += change
            if self.state[row, RELEASED] or not math.isfinite(drive.force):
                self._kept[tools] += self._dt * change

    def _moves_apart(self, drive: Drive, phase: int, velocity: Floats, ways: Floats) -> bool:
        """Whether a later phase moves the tools of a grip, which it gives these velocities (n, 3) [m/s], otherwise than
        as one along their ways: it lets go of their force."""
        moving = self._motion[phase] if phase < len(self._motion) else None
        if drive.way is not None or not isinstance(moving, MovePhase | TurnPhase):
            return False
        if isinstance(moving, TurnPhase) and {*drive.tools} <= {self._index[name] for name in moving.tools}:
            return False
        uneven = ways - ways.mean(axis=0)
        return abs(float((uneven * velocity).sum())) > ALIKE * float(np.abs(velocity).max())

    def _ways(self, drive: Drive, orientation: Floats) -> Floats:
        """Unit vectors along which its tools press (n, 3)."""
        grip = self._grips.of(drive.phase)
        if drive.way is not None or grip is None:
            return np.array([drive.way])
        return grip.inward_now(orientation)

    def _speed(self, row: int, drive: Drive, asked: float) -> float:
        """Eq. (2) for the force that is held and for the limit, which is one for each tool; the slower counts."""
        before, stiffness, mean, _, largest, _ = self.state[row].tolist()
        speed = asked
        inertia = (drive.mass + drive.added) / self._dt
        held = math.inf if self.state[row, RELEASED] else drive.force
        for force, resistance in ((held, mean), (drive.limit, largest)):
            k = stiffness if resistance > 0.0 else 0.0
            damping = 2.0 * math.sqrt(k * drive.mass) + (drive.added_damping if k > 0.0 else 0.0)
            needed = inertia * (asked - before) + resistance + k * self._dt * asked
            if needed > force:
                give = inertia + damping + k * self._dt
                speed = min(speed, (inertia * before + force - resistance) / give)
        return speed

    def save(self) -> Floats:
        """All that evolves (k,)."""
        return np.concatenate([self.state.ravel(), self.short.ravel()])

    def load(self, saved: Floats) -> None:
        """Continue from `save`."""
        state, short = np.split(saved, [self.state.size])
        self.state[:], self.short[:] = state.reshape(self.state.shape), short.reshape(self.short.shape)

    def measured(self, wrench: Floats, orientation: Floats) -> None:
        """Take in what the body did to the tools (t, 6) [N, N m] in a step that `apply` was called for."""
        if not self.drives:
            return
        self.short += self._kept
        for row, drive in enumerate(self.drives):
            felt = (-(wrench[list(drive.tools), :3] * self._ways(drive, orientation)).sum(axis=1)).tolist()
            largest = max(0.0, *felt)
            resistance = max(0.0, sum(felt) / len(felt)) if math.isfinite(drive.force) else largest
            state = self.state[row]
            moved = self._chosen[row] * self._dt
            k = float(state[STIFFNESS])
            change = resistance - float(state[RESISTANCE])
            if resistance == 0.0:
                k = drive.stiffness
            elif state[RESISTANCE] > 0.0 and moved != 0.0 and abs(change) > _TOLD * resistance:
                k = min(_MOST * drive.stiffness, _RISE * k, max(change / moved, _FALL * k, _LEAST * drive.stiffness))
            state[:RELEASED] = self._chosen[row], k, resistance, moved, largest


def _drives(scene: Scene, bodies: Sequence[AnyBody], grips: Grips) -> list[Drive]:
    """Each against the body that its tools are nearest to; against one of particles there is none."""
    names = list(scene.tools)
    closing = {name for phase in scene.motion if isinstance(phase, ClosePhase) for name in phase.tools}
    found = []
    for number, phase in enumerate(scene.motion):
        if isinstance(phase, ClosePhase):
            specs = [scene.tools[name] for name in phase.tools]
            limit = min(_limit(spec) for spec in specs)
            force = math.inf if phase.force is None else phase.force
            if not math.isfinite(min(force, limit)):
                continue
            grip = grips.of(number)
            if grip is None or not grip.body.has_cells:
                continue
            body, way = grip.body, grip.inward[0]
            width = float(np.ptp(bounding_points(body) @ way))
            added, added_damping = _added(body, way, width, scene.step)
            found.append(
                Drive(
                    phase=number,
                    tools=grip.tools,
                    way=None,
                    asked=0.0 if phase.force is None else phase.close,
                    force=force,
                    limit=limit,
                    mass=sum(_mass(spec) for spec in specs) / len(specs),
                    added=added,
                    added_damping=added_damping,
                    stiffness=_stiffness(body, width, scene.step),
                )
            )
        elif isinstance(phase, MovePhase):
            for name, move in phase.ways.items():
                spec = scene.tools[name]
                if name in closing or not math.isfinite(_limit(spec)) or not any(move):
                    continue
                way = np.array(move) / np.linalg.norm(move)
                assert not isinstance(spec, PlaneTool)  # it has no limit
                near = bodies[nearest_body(bodies, [AT_REST] * len(bodies), np.array(spec.position))]
                if not near.has_cells:
                    continue
                width = float(np.ptp(bounding_points(near) @ way))
                stiffness = _stiffness(near, width, scene.step)
                added, added_damping = _added(near, way, width, scene.step)
                tool, mass, limit = (names.index(name),), _mass(spec), _limit(spec)
                found.append(Drive(number, tool, way, 0.0, math.inf, limit, mass, added, added_damping, stiffness))
    return found


def _last_phases(scene: Scene, drives: list[Drive]) -> list[int]:
    """The phase before which each drive ends: the next that closes or opens one of its tools, or moves it unless it
    grips."""
    names = list(scene.tools)
    ends = []
    for drive in drives:
        kinds = (ClosePhase, OpenPhase) if drive.way is None else (ClosePhase, OpenPhase, MovePhase)
        mine = {names[tool] for tool in drive.tools}
        later = (
            number
            for number, phase in enumerate(scene.motion)
            if number > drive.phase and isinstance(phase, kinds) and mine & set(phase.tools)
        )
        ends.append(next(later, len(scene.motion) + 1))
    return ends


def _limit(spec: ToolSpec) -> float:
    return math.inf if isinstance(spec, PlaneTool) or spec.force_limit is None else spec.force_limit


def _mass(spec: ToolSpec) -> float:
    return 0.0 if isinstance(spec, PlaneTool) else spec.mass


def _stiffness(body: Body, width: float, dt: float) -> float:
    """k_0 of a body of this width, as if all of it were of its stiffest material [N/m]."""
    material = _stiffest(body)
    area = _cross_section(body, width)
    return material.density * material.wave_speed * area / dt + _at_rest(body, width)


def _at_rest(body: Body, width: float) -> float:
    """k_s of eq. (3) [N/m]."""
    material = _stiffest(body)
    modulus = material.lambda_ + 2.0 * material.mu
    return 2.0 * modulus * _cross_section(body, width) / width


def _added(body: Body, way: Floats, width: float, dt: float) -> tuple[float, float]:
    """m_a [kg] and c_a [N s/m] of eq. (3) for a body of this width along a unit vector (3,); 0 where waves cross a cell
    in a step.
    """
    cell = float(np.abs(body.along_axes(way)) @ body.edges)
    layer = body.mean_density * _cross_section(body, width) * cell
    mass = _ADDED * layer * max(0.0, 1.0 - _stiffest(body).wave_speed * dt / cell)
    return mass, math.sqrt(_at_rest(body, width) * mass)


def _cross_section(body: Body, width: float) -> float:
    """Mean over the width [m^2]."""
    return float(body.cell_mass.sum()) / (body.mean_density * width)


def _stiffest(body: Body) -> Material:
    return max(body.materials, key=lambda each: each.elastic.p_wave)
