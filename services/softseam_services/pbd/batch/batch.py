"""Many pieces of one scene, stepped together: XPBD as `substep` has it, in float32, a piece a lane."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.scene.scene import Scene
from softseam_services.kernel_cache import compiling

from . import layout as rows
from .on_card import OnCard
from .on_processor import Indices, OnProcessor
from .pieces import Pieces, Singles, Structure

Device = Literal["cpu", "cuda"]


@dataclass(frozen=True)
class Outcome:
    """Of a step, of k pieces and t tools; forces and touching points are means over the step."""

    middle: Singles
    """centre of mass (k, 3) [m]"""
    stress: Singles
    """largest von Mises stress at a block's middle (k,) [Pa]"""
    strain: Singles
    """energy (k,) [J]"""
    least_j: Singles
    """least volume ratio of a block (k,)"""
    slip: Singles
    """farthest that a touching point has slid along a box since it touches (k,) [m]"""
    force: Singles
    """on each tool (k, t, 3) [N]"""
    touching: Singles
    """points that touch each tool (k, t)"""


class Batch:
    """k pieces; whatever their number and order, and however many threads, each one's bits are the same."""

    def __init__(
        self, scene: Scene, count: int, step: float, substeps: int, threads: int = 1, device: Device = "cpu"
    ) -> None:
        """Raises SettingError where the scene is not one that many pieces can share, see `Structure`, and where there
        is no such device. Threads are those of the processor."""
        self.structure = structure = Structure(scene)
        self.count, self._substeps, self._at = count, substeps, structure.layout
        timing = structure.timing(step, substeps)
        self._lanes: OnProcessor | OnCard
        if device == "cuda":
            self._lanes = OnCard(structure, count, timing)
        else:
            self._lanes = OnProcessor(structure, count, timing, threads)
        with compiling("batch"):
            self._lanes.step()  # of nothing: whoever waits for a step does not wait for the compiler
        room = np.arange(self._lanes.room)
        own = structure.numbers(structure.own(1))
        self._lanes.write(room, np.repeat(own, len(room), axis=0))

    def put(self, which: Indices, pieces: Pieces) -> None:
        """Put new pieces in the places `which`, at rest."""
        self._lanes.write(which, self.structure.numbers(pieces))

    def step(self, way: NDArray[np.float64]) -> Outcome:
        """A step in which each tool goes a way (k, t, 3) [m]."""
        for tool in range(way.shape[1]):
            first = self._at.tools + rows.N_OF_TOOL * tool + rows.WAY
            self._lanes.write_rows(first, (way[:, tool] / self._substeps).astype(np.float32))
        self._lanes.step()
        return self.outcome()

    def outcome(self) -> Outcome:
        """Of the last step."""
        out, t = self._lanes.read_rows(self._at.out, self._at.rows), len(self.structure.kind)
        of_tools = out[:, rows.N_OUT :].reshape(-1, t, rows.N_OUT_OF_TOOL)
        return Outcome(
            middle=out[:, rows.MIDDLE : rows.MIDDLE + 3],
            stress=np.sqrt(out[:, rows.STRESS2]),
            strain=out[:, rows.STRAIN],
            least_j=out[:, rows.LEAST_J],
            slip=np.sqrt(out[:, rows.SLIP]),
            force=of_tools[:, :, :3],
            touching=of_tools[:, :, 3],
        )

    def place_of(self, node: int) -> Singles:
        """Where a node is in each piece (k, 3) [m]."""
        first = self._at.nodes + rows.N_OF_NODE * node + rows.X
        return self._lanes.read_rows(first, first + 3)

    def places(self, piece: int) -> Singles:
        """Where the nodes of a piece are (n, 3) [m]."""
        node = self._lanes.read(piece)[self._at.nodes : self._at.blocks].reshape(-1, rows.N_OF_NODE)
        return node[:, rows.X : rows.X + 3].copy()

    def poses(self, piece: int) -> tuple[Singles, Singles]:
        """Where the tools of a piece are (t, 3) [m], and how they are turned, by matrices from their own frames."""
        tool = self._lanes.read(piece)[self._at.tools : self._at.nodes].reshape(-1, rows.N_OF_TOOL)
        place, turn = tool[:, rows.POSITION : rows.POSITION + 3], tool[:, rows.TURN : rows.TURN + 9]
        return place.copy(), turn.reshape(-1, 3, 3).copy()

    def snapshot(self, piece: int) -> bytes:
        """Everything that a piece's future depends on, and nothing else: the same bits whatever is beside it."""
        numbers, t = self._lanes.read(piece), len(self.structure.kind)
        pair = numbers[self._at.pairs : self._at.out].reshape(-1, t, rows.N_OF_PAIR)
        # What is scratch of a substep is written where only other pieces are near a tool, too, and so is a zero's sign.
        pair[:, :, rows.FACED : rows.SINCE] = 0.0
        return (numbers + np.float32(0.0)).tobytes()

    def restore(self, piece: int, state: bytes) -> None:
        """Take over a snapshot, of any piece of the same scene. Raises ValueError where it is of another one."""
        if len(state) != 4 * self._at.rows:
            raise ValueError(f"a snapshot of {len(state)} bytes is of another scene: here are {4 * self._at.rows}")
        self._lanes.write(np.array([piece]), np.frombuffer(state, np.float32)[None])

    def close(self) -> None:
        """End what steps the pieces."""
        self._lanes.close()
