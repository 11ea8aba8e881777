"""Several bodies in one scene, which do not touch: each moves as if it were alone, to the bit."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from several_bodies import NAMES, alone, several

import softseam
from softseam.pictures import draw_pictures
from softseam.recording import Recording
from softseam.replay.verify import verify
from softseam.report import ReportBuilder
from softseam_protocol.messages.participant import Advance, Reply, Request
from softseam_protocol.messages.session import Frame, StepReport
from softseam_protocol.scene.file import bundle_scene, parse_scene
from softseam_protocol.scene.scene import Scene, SeveralBodies
from softseam_services.orchestrator.archive import ArchiveError
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.orchestrator.transport import ParticipantLost

FIELDS = ("x", "cauchy", "contact_force", "multiplier", "cell_energy", "point_strain")


def simulation(scene: Scene, transport: EmbeddedTransport | None = None) -> Simulation:
    return Simulation(bundle_scene(scene), transport or EmbeddedTransport())


def run(sim: Simulation, steps: int) -> tuple[list[StepReport], dict[str, Frame]]:
    reports = [sim.step(fields=n == steps - 1) for n in range(steps)]
    return reports, sim.frames()


def same(one: Frame, other: Frame) -> bool:
    return all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in FIELDS)


@pytest.fixture(scope="module")
def together() -> tuple[list[StepReport], dict[str, Frame]]:
    """All three to the end of the motion, lifted."""
    sim = simulation(several())
    assert sim.expected_steps is not None
    found = run(sim, sim.expected_steps)
    assert sim.done
    sim.close()
    return found


@pytest.mark.parametrize("name", NAMES)
def test_a_body_in_company_is_as_if_alone(name: str, together: tuple[list[StepReport], dict[str, Frame]]) -> None:
    """The jelly and the sheet know nothing of the tools that close on the tofu; its grip is one for all of them."""
    reports, frames = together
    sim = simulation(alone(name))
    for n, report in enumerate(reports):
        command = np.hstack([report.command, report.turning])
        velocities = {tool: command[i].tolist() for i, tool in enumerate(sim.tools.names)}
        own = sim.step(velocities, fields=n == len(reports) - 1)
        for part, told in own.parts.items():
            assert report.parts[part.replace("body", name)].strain == told.strain
    assert same(sim.frames()["body"], frames[name])
    sim.close()


def test_reports_are_of_all_bodies_with_their_names(together: tuple[list[StepReport], dict[str, Frame]]) -> None:
    reports, _ = together
    last = reports[-1]
    assert {part.body for part in last.parts.values()} == set(NAMES)
    assert list(last.interfaces) == ["tofu.seam"] and last.seam == last.interfaces["tofu.seam"]
    quantities = last.quantities
    assert quantities["tofu.grip_force"] > 1.0 and quantities["jelly.grip_force"] == 0.0
    assert quantities["tofu.lift_height"] > 0.008 and abs(quantities["jelly.lift_height"]) < 1e-4
    assert quantities["middle.displacement"] > 0.008 > quantities["wobble.displacement"]
    assert "tofu.compression" in quantities and "jelly.compression" not in quantities
    assert "nori.worst_stretch" in quantities and "nori.peak_von_mises" not in quantities
    assert set(several().asked) <= quantities.keys()
    for name in ("kinetic", "strain", "gravity"):
        whole = sum(getattr(part, name) for part in last.parts.values())
        assert last.energy[name] == pytest.approx(whole, rel=1e-12)


def test_a_snapshot_continues_bit_for_bit() -> None:
    first, second = simulation(several()), simulation(several())
    run(first, 12)
    state = first.save()
    second.load(state)
    (went_on, one), (resumed, other) = run(first, 12), run(second, 12)
    assert all(same(one[name], other[name]) for name in NAMES)
    assert [report.quantities for report in went_on] == [report.quantities for report in resumed]
    with pytest.raises(ArchiveError, match="another scene"):
        simulation(alone("jelly")).load(state)


class Losing(EmbeddedTransport):
    """Loses one part's answer to an Advance of a step, once, after all others have taken theirs."""

    part, at = "", -1

    def exchange(self, requests: Mapping[str, Request]) -> dict[str, Reply]:
        replies = super().exchange(requests)
        asked = requests.get(self.part)
        if isinstance(asked, Advance) and asked.header.step == self.at:
            self.at = -1
            raise ParticipantLost(self.part, "the cable was cut")
        return replies

    def wait_alive(self, participant: str, timeout: float) -> bool:
        return False


@pytest.mark.parametrize("part", ["jelly.far", "tofu.near"])
def test_where_one_body_cannot_take_a_step_none_has(
    part: str, together: tuple[list[StepReport], dict[str, Frame]]
) -> None:
    """The step is then taken by all of them, and is what it would have been."""
    reports, frames = together
    transport = Losing()
    sim = simulation(several(), transport)
    for n in range(len(reports)):
        if n == 8:
            transport.part, transport.at = part, n
            with pytest.raises(ParticipantLost):
                sim.step()
            assert sim.time == pytest.approx(0.01 * n)
        report = sim.step(fields=n == len(reports) - 1)
        assert report.header.step == n
    for name in NAMES:
        np.testing.assert_allclose(sim.frames()[name].x, frames[name].x, rtol=0.0, atol=5e-6)  # the seam's own
    if part == "tofu.near":  # those without a seam begin each step anew
        assert same(sim.frames()["jelly"], frames["jelly"]) and same(sim.frames()["nori"], frames["nori"])


BEAM = """
  {name}:
    shape: {{kind: block, size: [0.04, 0.02, 0.02]}}
    cell: 0.02
    position: [{x}, 0, 1]
    material: {{kind: neo_hookean, young: 20000.0, poisson: 0.45, density: 1050}}
    regions: {{default: pbd, near: {{model: fem, boxes: [{{min: [-9, -9, -9], max: [{x}, 9, 9]}}]}}}}"""
TIED = f"""
softseam: 1
name: tied
duration: 0.3
bodies:{BEAM.format(name="first", x=0.0)}{BEAM.format(name="second", x=0.1)}
tools: {{ground: {{kind: plane, friction: 0.5}}}}
"""


@pytest.mark.parametrize("subdivided", [False, True])
def test_a_tied_body_takes_a_step_back_that_another_could_not(subdivided: bool) -> None:
    """Two cut bodies fall; the second is lost in a step that the first has taken, whole or in parts."""
    ends = []
    for fails in (False, True):
        transport = Losing()
        sim = simulation(parse_scene(TIED), transport)
        for n in range(30):
            if n == 8 and subdivided:
                coupling = sim.bodies["first"].participants._coupling
                assert coupling is not None
                coupling.pace.cut()
            if n == 8 and fails:
                transport.part, transport.at = "second.far", n
                with pytest.raises(ParticipantLost):
                    sim.step()
            assert sim.step().header.step == n
        ends.append(sim.frames())
    for name in ("first", "second"):
        np.testing.assert_allclose(ends[1][name].x, ends[0][name].x, rtol=0.0, atol=6e-6)  # the seam's own


def test_what_only_one_body_has_is_refused_for_several() -> None:
    sim = simulation(several())
    with pytest.raises(SeveralBodies, match="jelly, nori, tofu"):
        sim.frame()
    with pytest.raises(SeveralBodies, match="several bodies"):
        _ = sim.scene.body
    with softseam.open(several()) as session:
        seen = session.reset()
        assert list(seen.bodies) == list(NAMES) and seen.bodies["tofu"].positions.shape[1] == 3
        with pytest.raises(softseam.BadInput, match="take one of `bodies`"):
            _ = seen.positions
    with pytest.raises(softseam.BadInput, match=r"bodies\.\w+\.regions"):
        softseam.open(several(), model="fem")


def test_one_recording_one_report_one_replay(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with softseam.open(several(), record=path) as session:
        session.run()
    recording = Recording(path)
    assert set(recording.surfaces) == set(NAMES)
    steps = recording.counts["StepReport"]
    assert recording.counts["Frame"] == 3 * (steps + 1) == 3 * len(list(recording.frames("nori")))
    found = verify(recording)
    assert found.same and found.frames == 3 * steps
    builder = ReportBuilder(recording.bundle)
    for message in recording:
        builder.add(message)
    report = builder.build()
    assert report["verdict"]["outcome"] == "lifted"
    assert {name.partition(".")[0] for name in report["parts"]} == set(NAMES)
    assert report["quantities"]["tofu.grip_force"]["asked"] and not report["quantities"]["tofu.slip"]["asked"]
    assert len(draw_pictures(recording, tmp_path)) == 3
