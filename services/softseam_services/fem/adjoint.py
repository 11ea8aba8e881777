"""What a number read off the body owes to a force anywhere in it: the adjoint of a cut body, solved on the whole of it.

Where a quantity J of the positions x changes by g . dx, and the body answers a force f with A dx = f,

    A z = g,     dJ = g . dx = z . f                                                                              (1)

so z (N, 3), the adjoint, says what every force on every node does to J (R. Becker, R. Rannacher, Acta Numerica 10
(2001) 1-102, section 2). A is FEM's stiffness of the whole body as it stands, undivided, contacts included: tools hold
what sticks to them and let slide what slips. So a seam needs no adjoint of its own, and PBD, which has no stiffness
matrix, none at all; what PBD's stiffness differs by is of the order of the error that is weighed. Loads that change
slowly are what counts: inertia is that of a step in which waves cross the body a thousand times, which keeps A regular
where nothing holds the body.
"""

import numpy as np

from softseam_protocol.messages.participant import BodyState, ToolMotion
from softseam_protocol.scene.models import FemSpec
from softseam_services.body.body import Body, Floats, Region
from softseam_services.tools.edged import with_round_edges
from softseam_services.tools.tool_set import ToolSet

from .face_forces import taken_over
from .inputs import Inputs, NewtonSettings, at_rest, build_result, moved
from .integrators.scheme import IMPLICIT_EULER, Scheme
from .kernels import step as kernel
from .kernels.contact_columns import NORMAL, OPEN, PRESSURE, SLIP, TRACTION, TRIAL
from .kernels.elements import cauchy_stress
from .kernels.fronts import solve
from .kernels.newton import CONVERGED
from .model import FemModel
from .parameters import FemParameters
from .state import FemState
from .structures import build_tables
from .work import Work, build_work

_CROSSINGS = 1e3
"""times that waves cross the body in the step whose inertia counts"""
_NONE = np.zeros((0, 3))


class FemAdjoint:
    """The whole body as FEM takes it, a `weighing.Adjoint`; built once, factored at every look."""

    def __init__(self, body: Body, whole: Region, tools: ToolSet, spec: FemSpec) -> None:
        self.region = whole
        self.model: FemModel
        self.parameters: FemParameters
        self.model, self.parameters = build_tables(body, self.region, tools, spec)
        self.work: Work = build_work(self.model, self.parameters, len(tools.names))
        self._scheme = Scheme(IMPLICIT_EULER, np.ones(1), 0)
        self._whole, self._friction = at_rest(with_round_edges(tools, body)), tools.friction
        self._dt = _CROSSINGS * float(np.linalg.norm(np.ptp(body.x_rest, axis=0))) / body.wave_speed
        self._history, n_tools = np.zeros((0, body.n_nodes, 3)), len(tools.names)
        self._settings = NewtonSettings(1.0, 0, False)
        self._unused = build_result(body.n_cells, 0, n_tools, kernel.N_OUT)

    def factor(self, state: BodyState, position: Floats, orientation: Floats) -> bool:
        """Make A at a state of the body between tools at (t, 3) [m], (t, 4); False where A is not positive definite."""
        work = self.work
        force, tool = state.contact_force, state.contact_tool
        contact = taken_over(self.model, self.parameters, state.x, force, tool, len(self._friction))
        work.state[:] = OPEN
        work.factored_state[:] = OPEN
        tools = moved(self._whole, ToolMotion(position, orientation, position, orientation))
        still = np.zeros_like(state.x)
        at = FemState(np.ascontiguousarray(state.x), still, contact, self._history).arrays
        inputs = Inputs(self._dt, tools, _NONE, 0.0)
        status = kernel.advance(
            *(self._scheme, self.model, self.parameters, at, at, inputs, self._settings, work, self._unused),
            kernel.DERIVE,
        )
        return bool(status == CONVERGED)

    def solve(self, g: Floats) -> Floats:
        """z (N, 3) of eq. (1) for g (N, 3), with the factor at hand; 0 at clamped nodes."""
        free = np.flatnonzero(self.model.order >= 0)
        b = np.zeros((len(free), 3))
        b[self.model.order[free]] = g[free]
        flat = b.reshape(-1)
        solve(self.model.tree, self.work.values, flat, self.work.factoring)
        z = np.zeros_like(g)
        z[free] = b[self.model.order[free]]
        return z

    def push(self, direction: Floats) -> Floats:
        """g (N, 3) [N/m] of J = sum over tools of direction (t, 3) . force of the body on the tool."""
        model, parameters, work = self.model, self.parameters, self.work
        pairs = np.flatnonzero(work.state != OPEN)
        points, tools = work.pair[pairs].T
        row, hold, d = work.contact[pairs], work.hold[pairs], direction[tools]
        normal, slips = row[:, NORMAL : NORMAL + 3], work.state[pairs] == SLIP
        along = np.einsum("pi,pi->p", normal, d)[:, None] * normal
        # eq. (2) of kernels.contact with q = 1: a point that slips gives way along its slip
        mu = self._friction[tools] * parameters.friction_factor[points]
        bound = np.maximum(mu * row[:, PRESSURE], np.finfo(float).tiny)
        way = row[:, TRACTION : TRACTION + 3] / bound[:, None]
        across = d - along
        sliding = across - np.einsum("pi,pi->p", way, across)[:, None] * way
        sliding *= (bound / np.maximum(row[:, TRIAL], bound))[:, None]
        force = hold[:, :1] * (along + np.where(slips[:, None], sliding, across))
        g = np.zeros((len(model.order), 3))
        count = np.diff(model.point_ptr)[points]
        entry = np.repeat(model.point_ptr[points] - np.cumsum(count) + count, count) + np.arange(count.sum())
        lean = np.repeat(work.lean[pairs], count, axis=0)
        weight = parameters.point_weight[entry] + np.sum(lean * parameters.point_tilt[entry], axis=1)
        np.add.at(g, model.point_node[entry], weight[:, None] * np.repeat(force, count, axis=0))
        return g

    def forces(self) -> Floats:
        """f_int of each cell on its nodes (C, 27, 3) [N] at the state of `factor`, which must have come just before."""
        return np.asarray(self.work.fe.transpose(0, 2, 1))

    def stress(self, x: Floats) -> Floats:
        """Cauchy stress of all octants at x (N, 3), xx yy zz yz xz xy (C, 8, 6) [Pa]."""
        cauchy = np.zeros((len(self.model.cell_nodes), 8, 6))
        cauchy_stress(x, self.model, self.parameters, self.work, cauchy)
        return cauchy
