"""A made-up but lifelike run: a soft cube squeezed between plates and lifted, as messages. No solver is involved.

The deformation is a closed form (squeezed along x, bulging along y and z), the stress follows a smooth bump near the
plates; what matters is that shapes, units and the order of messages are those of a real run.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.recording import Begin
from softseam_protocol.messages.session import Event, Frame, InterfaceReport, PartReport, StepReport
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.build import build_body
from softseam_services.recorder.begin import begin
from softseam_services.tools.build import build_tools

SCENE = {
    "softseam": 1,
    "name": "squeeze",
    "step": 0.01,
    "body": {
        "shape": {"kind": "block", "size": [0.05, 0.05, 0.05]},
        "cell": 0.0125,
        "material": {"kind": "neo_hookean", "young": 20e3, "poisson": 0.45, "density": 1050.0},
    },
    "tools": {
        "ground": {"kind": "plane", "friction": 0.5},
        "left": {"kind": "box", "size": [0.01, 0.06, 0.06], "position": [-0.032, 0, 0.033], "friction": 0.6},
        "right": {"kind": "box", "size": [0.01, 0.06, 0.06], "position": [0.032, 0, 0.033], "friction": 0.6},
        "ball": {"kind": "sphere", "radius": 0.008, "position": [0, 0.05, 0.008]},
    },
    "motion": [
        {"tools": ["left", "right"], "close": 0.02, "until": {"compression": 0.15}},
        {"tools": ["left", "right"], "move": [0, 0, 0.05], "speed": 0.05},
    ],
    "regions": {"default": "pbd", "near": {"model": "fem", "within": 0.012, "split": "always"}},
    "quantities": ["grip_force", "lift_height", "slip", "peak_von_mises"],
}


class Squeeze:
    """`begin`, then `messages()`: n steps of 10 ms; `drop` lets the body fall while the plates go on."""

    def __init__(self, n_steps: int = 60, *, cell: float = 0.0125, drop: bool = False, session: str = "test") -> None:
        body_spec = {**SCENE["body"], "cell": cell}  # type: ignore[dict-item]
        self.scene = Scene.model_validate({**SCENE, "body": body_spec})
        self.bundle = Bundle(scene=self.scene.model_dump_json(), files={"notes.txt": b"carried along"})
        self.body: Body = build_body(self.scene, {})
        self.begin: Begin = begin(self.bundle, {"body": self.body}, build_tools(self.scene, self.body), session, seed=7)
        self.n_steps, self.drop, self.session = n_steps, drop, session
        mid = self.body.x_rest[self.body.cell_nodes[:, 13]]
        self.cell_mid = mid
        self.near = np.abs(mid[:, 0]) > 0.0125
        nodes_near = np.unique(self.body.cell_nodes[self.near])
        nodes_far = np.unique(self.body.cell_nodes[~self.near])
        self.seam = np.intersect1d(nodes_near, nodes_far).astype(np.int32)

    def messages(self) -> Iterator[StepReport | Frame | Event]:
        yield Event(self.header(0), EventKind.TOOLS, "phase 0: left and right close")
        for k in range(1, self.n_steps + 1):
            s = k / self.n_steps
            grip, lift = min(1.0, 2.5 * s), 0.05 * max(0.0, (s - 0.45) / 0.55)
            if k == round(0.45 * self.n_steps):
                yield Event(self.header(k), EventKind.TOOLS, "phase 1: left and right move by (0, 0, 50) mm")
            if k == round(0.2 * self.n_steps):
                yield Event(self.header(k), EventKind.REGIONS, "32 cells are near now: left and right touch")
            yield self._report(k, grip, lift)
            yield self._frame(k, grip, lift)

    def header(self, k: int) -> Header:
        return Header(SCHEMA_VERSION, self.session, "", 0, max(k - 1, 0), 0, 0.01 * max(k - 1, 0))

    def _body_lift(self, lift: float) -> float:
        return 0.15 * lift if self.drop else lift

    def _tools(self, grip: float, lift: float) -> np.ndarray:
        reach = 0.032 - 0.0107 * grip
        return np.array([[0, 0, 0], [-reach, 0, 0.033 + lift], [reach, 0, 0.033 + lift], [0, 0.05, 0.008]], dtype=float)

    def _deform(self, x: np.ndarray, grip: float, lift: float) -> np.ndarray:
        squeeze = 0.15 * max(0.0, (grip - 0.65) / 0.35)
        bulge = 1.0 + 0.45 * squeeze * (1.0 - (x[:, :1] / 0.025) ** 2)
        out = x.copy()
        out[:, :1] *= 1.0 - squeeze
        out[:, 1:2] *= bulge
        out[:, 2:3] = 0.025 + (x[:, 2:3] - 0.025) * bulge - 0.001 * (1 - (x[:, :1] / 0.025) ** 2) * (lift > 0)
        out[:, 2] += self._body_lift(lift)
        return out

    def _grip_force(self, grip: float, lift: float) -> float:
        dropped = self.drop and lift > 0.02
        return 0.0 if dropped else 13.1 * max(0.0, (grip - 0.65) / 0.35)

    def _report(self, k: int, grip: float, lift: float) -> StepReport:
        force = self._grip_force(grip, lift)
        wrench = np.zeros((4, 6))
        wrench[1, 0], wrench[2, 0] = -force, force
        wrench[1, 2] = wrench[2, 2] = -0.6 if lift > 0 and force > 0 else 0.0
        strain = 5e-3 * (force / 13.1) ** 2
        near, far = int(self.near.sum()), int((~self.near).sum())
        command = np.zeros((4, 3))
        command[1, 0], command[2, 0] = (0.02, -0.02) if lift == 0 else (0.0, 0.0)
        command[1:3, 2] = 0.05 if lift > 0 else 0.0
        return StepReport(
            header=self.header(k),
            phase=int(lift > 0),
            tool_position=self._tools(grip, lift),
            tool_orientation=np.tile([1.0, 0.0, 0.0, 0.0], (4, 1)),
            wrench=wrench,
            quantities={
                "grip_force": force,
                "lift_height": self._body_lift(lift),
                "slip": 2e-4 * (force > 0) + (lift - self._body_lift(lift)),
                "peak_von_mises": 450.0 * force,
            },
            interfaces={
                "body.seam": InterfaceReport(
                    gap=2e-8 * (1 + 0.5 * np.sin(k)),
                    exchanges=1 + k % 3,
                    n_nodes=len(self.seam),
                    force=0.02 * force,
                    work=1e-9,
                )
            },
            parts={
                "body.near": PartReport("body", "fem", near, 45 * 9, 1e-5, 0.7 * strain, 0.1 * lift, 1, 3e-4),
                "body.far": PartReport("body", "pbd", far, 27 * 9, 1e-5, 0.3 * strain, 0.1 * lift, 12, 2e-4),
            },
            energy={
                "kinetic": 2e-5,
                "strain": strain,
                "gravity": 1.28 * self._body_lift(lift),
                "tool_work": (0.072 + 5e-3) / self.n_steps,
                "seam_work": 1e-9,
                "dissipation": 1e-5,
                "switch": 0.0,
            },
            momentum=np.array([0.0, 0.0, 0.13 * 0.05 * (lift > 0)]),
            angular_momentum=np.zeros(3),
            penetration=2e-6 * (force > 0),
            seconds={"fem": 3e-4, "pbd": 2e-4, "coupling": 5e-5, "bus": 0.0, "record": 3e-5, "total": 6e-4},
            done=k == self.n_steps,
            command=command,
        )

    def _frame(self, k: int, grip: float, lift: float) -> Frame:
        body, surface = self.body, self.body.surface
        force = self._grip_force(grip, lift)
        octant = np.array([[i, j, m] for m in (-0.25, 0.25) for j in (-0.25, 0.25) for i in (-0.25, 0.25)]) * body.edges
        at = self.cell_mid[:, None, :] + octant
        cauchy = np.zeros((body.n_cells, 8, 6))
        bump = 1.0 + 2.0 * np.exp(
            -(((np.abs(at[..., 0]) - 0.025) / 0.008) ** 2 + ((np.abs(at[..., 2] - 0.025) - 0.02) / 0.012) ** 2)
        )
        cauchy[..., 0] = -force / 0.0025 * bump
        cauchy[..., 4] = 60.0 * np.sign(at[..., 0]) * (lift > 0)
        rest = self.begin.surfaces["body"].point_rest
        contact = np.zeros_like(rest)
        tool = np.full(len(rest), -1, dtype=np.int32)
        if force > 0:
            for index, side in ((1, -1.0), (2, 1.0)):
                touching = np.abs(rest[:, 0] - side * 0.025) < 1e-9
                share = surface.area * touching
                tool[touching] = index
                contact[:, 0] -= side * force * share / share.sum()
                contact[:, 2] += 0.6 * (lift > 0) * share / share.sum()
        multiplier = np.zeros((len(self.seam), 3))
        multiplier[:, 0] = np.sign(body.x_rest[self.seam, 0]) * force / (0.5 * len(self.seam))
        return Frame(
            header=self.header(k),
            body="body",
            x=self._deform(body.x_rest, grip, lift),
            cauchy=cauchy,
            cell_near=self.near.astype(np.int8),
            point_x=self._deform(rest, grip, lift),
            contact_force=contact,
            contact_tool=tool,
            coupling_nodes=self.seam,
            multiplier=multiplier,
            tool_position=self._tools(grip, lift),
            tool_orientation=np.tile([1.0, 0.0, 0.0, 0.0], (4, 1)),
            cell_energy=0.5 * grip * force * np.full(body.n_cells, 1.0 / body.n_cells),
        )
