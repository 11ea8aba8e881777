"""What the author of a simple solver writes: how a part moves in a step. The rest has defaults.

A part is a function from state to state. What is taken back, repeated, saved and restored is so to the bit, as long as
`step` and `response` compute from their arguments and from what `__init__` made.
"""

import json
from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from softseam_protocol.messages.participant import Configure, ToolMotion
from softseam_protocol.participant.part_mesh import has_tetrahedra, mesh_of, surface_points
from softseam_protocol.participant.state import State, sound

Floats = NDArray[np.float64]


class Unconverged(Exception):
    """A step was not solved: `Part.step` raises it with the cause and the remedy, and is asked for a shorter one."""


class Part(ABC):
    """The part that a Configure describes (n nodes, c cells, s coupling nodes, p surface points)."""

    corrects: ClassVar[bool] = True
    """whether a small force moves a step by its `response`, where that is written"""
    substeps: ClassVar[int] = 1
    """that a step is made of"""
    cost: ClassVar[float] = 0.0
    """expected processor time of a step [s]; 0: not known"""

    def __init__(self, request: Configure) -> None:
        """Begin in the state that is reported, or at rest with the body's velocity.

        A solver's own `__init__` calls this first; one whose `State.own` holds something replaces `begin`. Raises
        ValueError for a part that it cannot take.
        """
        mesh = self.mesh = mesh_of(request)
        """nodes, masses [kg], cells and surface points"""
        self.scene: dict[str, Any] = json.loads(request.bundle.scene)
        bodies = self.scene.get("bodies") or {request.body: self.scene["body"]}
        self.body: dict[str, Any] = bodies[request.body]
        """as the scene describes it"""
        self.gravity = np.array(self.scene["gravity"], dtype=float)
        """(3,) [m/s^2]"""
        self.coupling = np.searchsorted(mesh.nodes, request.coupling_nodes)
        """places of the coupling nodes among the part's (s,)"""
        if type(self).surface is Part.surface and has_tetrahedra(mesh):
            raise ValueError("a cell is a tetrahedron: this participant knows hexahedra alone")
        rest = State(mesh.x_rest, np.tile(self.body.get("velocity", np.zeros(3)), (len(mesh.nodes), 1)))
        reported = request.state
        self.begin = sound(rest if reported is None else State(reported.x[mesh.nodes], reported.v[mesh.nodes]), rest)
        """the state that it begins with"""

    @abstractmethod
    def step(self, state: State, dt: float, force: Floats, tools: ToolMotion) -> State:
        """The state after a step of dt [s] under gravity and constant forces on the coupling nodes (s, 3) [N].

        Raises Unconverged where it is not solved, and ValueError where it cannot be served as it is.
        """

    @abstractmethod
    def strain_energy(self, state: State) -> Floats:
        """Of each cell (c,) [J]."""

    def response(self, state: State, dt: float) -> Floats:
        """How all nodes move by a small force on the coupling nodes in a step that begins here (3n, 3s) [m/N]."""
        return np.zeros((0, 0))

    def stress(self, state: State) -> Floats:
        """Cauchy's, xx yy zz yz xz xy, in each octant of each cell (c, 8, 6) [Pa]."""
        return np.zeros((len(self.mesh.cell_nodes), 8, 6))

    def surface(self, state: State) -> Floats:
        """Positions of the surface points (p, 3) [m]; of hexahedra and of points alone, where it is not written."""
        return surface_points(self.mesh, state.x)
