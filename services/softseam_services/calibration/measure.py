"""What a PBD region really shows at some substeps and sweeps: stiffness, frequency and damping of its slowest mode.

The body, clamped as in its scene but without tools and gravity, is let go from its slowest mode, 1e-3 large. With the
modal coordinate q_k = u^T M (x_k - X) after steps of length D, free motion A exp(-zeta t) cos(omega_d t + phi) obeys

q_{k+1} = a q_k + b q_{k-1},  whose roots are exp((-zeta +- i omega_d) D)                                       (1)

and omega_0^2 = omega_d^2 + zeta^2 = K/M gives the stiffness. Implicit Euler alone has zeta = omega^2 h/2: it loses

1 - exp(-pi omega h)                                                                                           (2)

of its amplitude a period. Measured on bodies of 1 to 600 cells, (2) holds to some per cent where omega h < 0.1; a sweep
that lags loses up to a third less than it says. Leapfrog loses nothing; its error of omega goes with h^2. What should
be lost is the scene's damping, zeta = (a/omega + b omega)/2.
"""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import Status
from softseam_protocol.messages.participant import Advance, BodyState
from softseam_protocol.scene.models import PbdSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body, Floats
from softseam_services.body.region import build_region
from softseam_services.pbd.parameters import with_damping_of
from softseam_services.pbd.solver import PbdSolver
from softseam_services.tools.build import build_tools
from softseam_services.tools.motion import tool_motion

from .modes import BLOCK_REACH, CELL_REACH, block_force, cell_force, node_grid, slowest_mode, stiffness

MOST_CELLS = 600
"""beyond, the stiffness matrices of the oscillation take too long"""
SAMPLES = 40
"""steps a period"""
SKIPPED = 2
"""first samples, while the stress finds its lag"""
STRAIN = 1e-3
"""amplitude over the body's length"""
TRIALS = 5
"""counts of substeps tried on the way to the tolerance"""


@dataclass(frozen=True)
class Wanted:
    """What the region should show."""

    young: float
    """[Pa]"""
    frequency: float
    """slowest oscillation of hex27 cells in the place of the blocks [Hz]"""
    blocks: float
    """and of the blocks themselves with an exact integration in time [Hz]"""
    loss: float = 0.0
    """share of its amplitude that the oscillation should lose a period, by the scene's damping [1]"""


@dataclass(frozen=True)
class Shown:
    """What it shows at a setting."""

    substeps: int
    """of a step of the scene"""
    sweeps: int
    auto: bool
    """whether `substeps: auto` takes this"""
    stable: bool
    frequency: float
    """[Hz], 0 where nothing oscillates"""
    young: float
    """that of a body which oscillates so [Pa]"""
    time_error: float
    """of Young's modulus, by the integration in time and the sweeps alone [1]"""
    loss: float
    """share of its amplitude that the oscillation loses a period [1]"""
    seconds: float
    """CPU time of a step [s]"""

    wanted_loss: float = 0.0
    """and what it should [1]"""

    @property
    def loss_error(self) -> float:
        """Loss beyond what is wanted [1]."""
        return abs(self.loss - self.wanted_loss)

    def within(self, tolerance: float) -> bool:
        """Whether stiffness in time and loss are."""
        return self.stable and abs(self.time_error) <= tolerance and self.loss_error <= tolerance


class Bench:
    """A body ready to be let go with any setting. Raises ValueError for bodies beyond MOST_CELLS, or coarse ones."""

    def __init__(self, scene: Scene, body: Body) -> None:
        if body.n_cells > MOST_CELLS:
            raise ValueError(
                f"calibrating takes bodies of at most {MOST_CELLS} cells, this one has {body.n_cells}: "
                "coarsen it with --set body.cell=..., the losses follow from frequency and substep alone"
            )
        if scene.models.pbd.coarse is not None:
            raise ValueError(
                "calibrating compares PBD with finite elements node by node, which cells of one block do not have: "
                "leave out models.pbd.coarse"
            )
        self._step = scene.step
        self.scene = scene.model_copy(update={"tools": {}, "motion": (), "gravity": (0.0, 0.0, 0.0)})
        self.body = replace(body, gravity=np.zeros(3), v_initial=np.zeros_like(body.v_initial))
        self._tools = build_tools(self.scene)
        everything = np.arange(body.n_cells, dtype=np.int32)
        self._region = build_region(self.body, everything, np.zeros(0, dtype=np.int32))
        solver = self._solver(self._spec("auto", 1), scene.step, None)
        grid, x = node_grid(body), body.x_rest
        length = float(np.ptp(x, axis=0).max())
        rate, step = body.wave_speed / length, 1e-5 * float(body.edges.min())
        free = solver.parameters.arrays.inverse_mass > 0.0
        self._mass = self._region.mass
        cells = stiffness(cell_force(self.body), x, grid, CELL_REACH, step)
        blocks = stiffness(block_force(solver), x, grid, BLOCK_REACH, step)
        exact, _ = slowest_mode(cells, self._mass, free, rate)
        self._omega, mode = slowest_mode(blocks, self._mass, free, rate)
        self._mode = STRAIN * length * mode
        self.wanted = Wanted(body.material.young, exact / (2.0 * math.pi), self._omega / (2.0 * math.pi), self._loss())

    def auto(self, sweeps: int) -> int:
        """Substeps of a step of the scene by the automatic rule."""
        return self._solver(self._spec("auto", sweeps), self._step, None).substeps

    def show(self, substeps: int, sweeps: int) -> Shown:
        """Let the body go and watch it for a period."""
        h = self._step / substeps
        period = 2.0 * math.pi / self._omega
        together = max(1, round(period / (SAMPLES * h)))
        start = BodyState(
            self.body.x_rest + self._mode,
            np.zeros_like(self._mode),
            np.zeros((self.body.n_points, 3)),
            np.full(self.body.n_points, -1, dtype=np.int32),
        )
        solver = self._solver(self._spec(together, sweeps), together * h, start)
        motion = tool_motion(self._tools.position, self._tools.orientation, np.zeros((0, 6)), together * h)
        q, quickest, stable = [], math.inf, True
        for step in range(SKIPPED + max(8, math.ceil(period / (together * h)))):
            header = Header(SCHEMA_VERSION, "calibrate", "far", 0, step, 0, step * together * h)
            began = time.process_time()
            reply = solver.advance(Advance(header, together * h, np.zeros((0, 3)), motion))
            quickest = min(quickest, time.process_time() - began)
            solver.commit()
            stable = stable and reply.status is Status.CONVERGED and not reply.alarms
            q.append(float(np.einsum("n,nc,nc->", self._mass, self._mode, solver.positions - self.body.x_rest)))
        omega, damping = oscillation(np.array(q[SKIPPED:]), together * h)
        square = omega**2 + damping**2
        blocks, cells = self._omega, 2.0 * math.pi * self.wanted.frequency
        return Shown(
            substeps,
            sweeps,
            substeps == self.auto(sweeps),
            stable,
            omega / (2.0 * math.pi),
            self.wanted.young * square / cells**2,
            square / blocks**2 - 1.0,
            1.0 - math.exp(-2.0 * math.pi * damping / omega) if omega > 0.0 else 1.0,
            quickest / together * substeps,
            self.wanted.loss,
        )

    def _loss(self) -> float:
        """1 - exp(-2 pi zeta/sqrt(1 - zeta^2)) with zeta = (a/omega + b omega)/2, 1 where nothing oscillates."""
        damping = with_damping_of(self.body, self.scene.models.pbd).damping
        ratio = 0.5 * (damping.mass / self._omega + damping.stiffness * self._omega)
        return 1.0 - math.exp(-2.0 * math.pi * ratio / math.sqrt(1.0 - ratio**2)) if ratio < 1.0 else 1.0

    def _spec(self, substeps: int | str, sweeps: int) -> PbdSpec:
        given = self.scene.models.pbd.model_dump()
        return PbdSpec.model_validate({**given, "substeps": substeps, "sweeps": sweeps, "residual": None})

    def _solver(self, spec: PbdSpec, step: float, state: BodyState | None) -> PbdSolver:
        models = self.scene.models.having(spec)
        scene = self.scene.model_copy(update={"models": models, "step": step})
        return PbdSolver(scene, self.body, self._region, self._tools, state)


def oscillation(q: Floats, dt: float) -> tuple[float, float]:
    """omega_d and zeta [1/s] of eq. (1), by least squares; omega_d is 0 where nothing oscillates."""
    if not np.isfinite(q).all():
        return 0.0, 0.0
    a, b = np.linalg.lstsq(np.stack([q[1:-1], q[:-2]], axis=1), q[2:], rcond=None)[0]
    if a * a + 4.0 * b >= 0.0:
        return 0.0, 0.0
    return float(np.arctan2(np.sqrt(-a * a - 4.0 * b), a) / dt), float(-0.5 * np.log(-b) / dt)


def settings(bench: Bench, tolerance: float) -> Iterator[Shown]:
    """What settings about the automatic one show, then more and more substeps until all is within the tolerance.

    The loss goes with the substep, eq. (2), so each further count follows from the last.
    """
    planned = bench.auto(1)
    explicit = bench.scene.models.pbd.method == "leapfrog"
    counts = sorted({planned if explicit else max(1, planned // 2), planned, 2 * planned})
    last = bench.show(counts[0], 1)
    yield last
    for substeps in counts[1:]:
        last = bench.show(substeps, 1)
        yield last
    if not explicit:
        yield bench.show(bench.auto(2), 2)
    for _ in range(TRIALS):
        if last.within(tolerance):
            return
        worse = max(last.loss_error, abs(last.time_error)) / tolerance if last.stable and last.frequency > 0.0 else 2.0
        last = bench.show(math.ceil(last.substeps * max(1.02, min(worse, 8.0))), 1)
        yield last


def cheapest(shown: list[Shown], tolerance: float) -> Shown | None:
    """The least CPU time within the tolerance, if any setting is; fewer sweeps of all blocks count as less."""
    good = [each for each in shown if each.within(tolerance)]
    return min(good, key=lambda each: each.substeps * each.sweeps, default=None)


def calibrate(scene: Scene, body: Body, tolerance: float) -> tuple[Wanted, list[Shown]]:
    """All that `softseam calibrate` prints."""
    bench = Bench(scene, body)
    return bench.wanted, list(settings(bench, tolerance))
