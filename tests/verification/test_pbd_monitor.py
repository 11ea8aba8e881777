"""The PBD monitor: what it sees, what it does at once, and that it says so; shapes torn in every way come back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pbd_run import PbdRun, block_scene

from softseam.report import ReportBuilder
from softseam_protocol.messages.participant import Advanced, BodyState, Bundle
from softseam_protocol.messages.session import Event, Frame, StepReport
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.pbd.kernels import summary as k
from softseam_services.pbd.kernels import trust

Floats = NDArray[np.float64]


def torn(how: str, rest: Floats) -> Floats:
    rng = np.random.default_rng(0)
    shapes = {
        "crushed": rest * np.array([1.0, 1.0, 0.2]),
        "stretched": rest * np.array([5.0, 1.0, 1.0]),
        "flattened": rest * np.array([1.0, 1.0, 0.0]),
        "mirrored": rest * np.array([-1.0, 1.0, 1.0]),
        "scrambled": rng.uniform(-0.025, 0.025, rest.shape),
        "nearly a point": 1e-9 * rng.standard_normal(rest.shape),
        "one point": 0.0 * rest,
    }
    return np.ascontiguousarray(shapes[how])


@pytest.mark.parametrize(
    "how", ["crushed", "stretched", "flattened", "mirrored", "scrambled", "nearly a point", "one point"]
)
@pytest.mark.parametrize("sweeps", [1, 2])
def test_torn_shapes_recover_and_say_so(how: str, sweeps: int) -> None:
    """Finite in every step and whole after 3 s; the first step says what was wrong, the last is silent."""
    scene = block_scene(step=0.01, pbd={"sweeps": sweeps})
    run = PbdRun(scene, x=torn(how, PbdRun(scene).body.x_rest))
    first, *rest = run.run(3.0)
    assert first.alarms, how
    assert all(np.isfinite([reply.kinetic, reply.strain, reply.extras["residual"]]).all() for reply in rest)
    assert not rest[-1].alarms and rest[-1].extras["residual"] < trust.LAGGING
    assert run.committed.monitor[trust.LEAST_J] > 0.99
    # A strain of 1 % in all of the body is 1.25e-4 m^3 x 20 kPa x 1e-4/2.
    assert rest[-1].strain < 1.25e-4


@pytest.mark.parametrize("how", ["stretched", "mirrored", "scrambled"])
def test_soft_and_stiff_by_a_million_recover_alike(how: str) -> None:
    """Stiffness over a ratio of 1e6 at one density: the substep follows, and one sweep brings the shape back."""
    for young in (1e2, 1e8):
        scene = block_scene((0.05, 0.025, 0.025), 0.025, young=young, poisson=0.3, step=0.5 / young**0.5)
        run = PbdRun(scene, x=torn(how, PbdRun(scene).body.x_rest))
        replies = run.run(120 * scene.step)
        assert replies[0].alarms
        assert replies[-1].strain < 1e-4 * 3.125e-5 * young


def test_filled_to_a_millionth_next_to_full() -> None:
    """A stiffness ratio of 1e6 inside one body: octants that the body fills to 1e-6 beside full ones, kicked."""
    scene = block_scene((0.075, 0.025, 0.025), 0.025, step=0.005)
    run = PbdRun(scene)
    body = run.body
    thin = body.cell_grid[:, 0] == body.cell_grid[:, 0].max()
    body.fill[thin] *= 1e-6
    body.cell_mass[thin] *= 1e-6
    kick = 0.01 * body.material.wave_speed * np.random.default_rng(0).standard_normal(body.x_rest.shape)
    n_points = len(body.surface.cell)
    state = BodyState(body.x_rest.copy(), kick, np.zeros((n_points, 3)), np.full(n_points, -1, dtype=np.int32))
    run.region = type(run.region)(**{**vars(run.region), "mass": _mass(run)})
    run.solver = type(run.solver)(scene, body, run.region, run.tools, state)
    energy = [reply.kinetic + reply.strain for reply in run.run(0.5)]
    assert np.isfinite(energy).all() and energy[-1] < energy[0]


def _mass(run: PbdRun) -> Floats:
    """Nodal masses of a body whose cells' masses changed."""
    mass = np.zeros(len(run.region.nodes))
    np.add.at(mass, run.region.cell_nodes, run.body.cell_mass[run.region.cells])
    return mass


def replies_of_a_blow(residual: float) -> tuple[list[Advanced], PbdRun]:
    """A resting cube whose committed residual is pretended to be `residual`, hit by plates at 3 m/s."""
    plate = {"kind": "box", "size": (0.01, 0.1, 0.1), "friction": 0.6}
    tools = {"left": {**plate, "position": (-0.0301, 0.0, 0.0)}, "right": {**plate, "position": (0.0301, 0.0, 0.0)}}
    few = {"substeps": 2}
    run = PbdRun(block_scene((0.05, 0.05, 0.05), 0.025, tools=tools, moved=("left", "right"), step=0.002, pbd=few))
    run.step()
    run.velocity[:, 0] = 3.0, -3.0
    run.committed.monitor[trust.RESIDUAL] = residual
    return [run.step() for _ in range(4)], run


def test_a_residual_that_grows_repeats_the_step_with_more() -> None:
    """A blow leaves the stress far behind the shape: more substeps, more sweeps, and the reply names them."""
    replies, run = replies_of_a_blow(0.0)
    told = [reply for reply in replies if "the residual grows" in "".join(reply.alarms.values())]
    assert told
    assert told[0].extras["iterations"] == run.solver.substeps + 2 * run.solver.substeps * 2
    assert f"repeated with {2 * run.solver.substeps} substeps, sweeps 2" in "; ".join(told[0].alarms.values())


def test_figures_at_rest_and_in_known_shapes() -> None:
    """Residual 0 at rest; the stretch of a body pulled to twice its length is 2."""
    run = PbdRun(block_scene())
    assert run.step().extras["residual"] < 1e-9
    assert run.figures[k.STRETCH] == pytest.approx(1.0, abs=1e-9)
    pulled = PbdRun(block_scene(step=1e-7, pbd={"substeps": 1}), x=run.body.x_rest * np.array([2.0, 1.0, 1.0]))
    pulled.step()
    assert pulled.figures[k.STRETCH] == pytest.approx(2.0, rel=1e-3)


def residuals_of_a_blow(**changes: Any) -> list[float]:
    """The quantity over four steps of a cube between plates that shut at 3 m/s."""
    plate = {"kind": "box", "size": (0.01, 0.1, 0.1), "friction": 0.6}
    tools = {"left": {**plate, "position": (-0.0301, 0.0, 0.0)}, "right": {**plate, "position": (0.0301, 0.0, 0.0)}}
    scene = block_scene(tools=tools, moved=("left", "right"), step=0.002, pbd={})
    asked = {"regions": {"default": "pbd"}, "quantities": ["constraint_residual"], **changes}
    data = scene.model_dump(mode="json") | asked
    simulation = Simulation(Bundle(type(scene).model_validate(data).model_dump_json(), {}), EmbeddedTransport())
    reports = [simulation.step({"left": (3.0, 0.0, 0.0), "right": (-3.0, 0.0, 0.0)}) for _ in range(4)]
    simulation.close()
    return [report.quantities["constraint_residual"] for report in reports]


def test_the_residual_is_a_quantity_of_each_step() -> None:
    """A blow leaves the blocks' stress behind their shape, in the first step less so with more sweeps; FEM's none."""
    once = residuals_of_a_blow()
    often = residuals_of_a_blow(models={"pbd": {"sweeps": 8}})
    assert once[0] > 0.1 and often[0] < 0.3 * once[0]
    assert residuals_of_a_blow(regions={"default": "fem"}) == [0.0] * 4


def test_the_report_tells_what_the_monitor_did() -> None:
    """A cube between plates that shut at 3 m/s: an event in the stream, and in the report."""
    plate = {"kind": "box", "size": (0.01, 0.1, 0.1), "friction": 0.6}
    tools = {"left": {**plate, "position": (-0.0301, 0.0, 0.0)}, "right": {**plate, "position": (0.0301, 0.0, 0.0)}}
    scene = block_scene(tools=tools, moved=("left", "right"), step=0.002, pbd={})
    data = scene.model_dump(mode="json") | {"regions": {"default": "pbd"}}
    bundle = Bundle(type(scene).model_validate(data).model_dump_json(), {})
    builder = ReportBuilder(bundle)

    def take(message: StepReport | Event | Frame) -> None:
        builder.add(message)

    simulation = Simulation(bundle, EmbeddedTransport(), session="monitor", emit=take)
    for _ in range(4):
        simulation.step({"left": (3.0, 0.0, 0.0), "right": (-3.0, 0.0, 0.0)})
    simulation.close()
    events = [event for event in builder.build()["events"] if event["kind"] == "monitor"]
    assert events and "repeated with" in events[0]["message"]
