"""Replays: files that rerun accepts, a view that is not blank, a web viewer on loopback only, and verification."""

from __future__ import annotations

import http.client
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chromium import browse
from cubes import cube, scene_of
from damaged import with_a_bad_chunk
from matplotlib.image import imread
from screenshots import screenshots
from squeeze import SCENE, Squeeze

import softseam
from softseam.recording import Recording
from softseam.replay import ReplayError, replay, verify
from softseam.replay.show import free_port, web_address, web_arguments
from softseam.replay.viewer import REPORTING, quiet, running, viewer
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.recording import Begin
from softseam_protocol.messages.session import Frame
from softseam_protocol.scene.scene import Scene
from softseam_services.orchestrator.embedded import EmbeddedTransport
from softseam_services.orchestrator.simulation import Simulation
from softseam_services.recorder.begin import begin
from softseam_services.recorder.recorder import McapRecorder, Recordable

pytestmark = pytest.mark.slow


def write(path: Path, run: Squeeze) -> Path:
    with McapRecorder(path, run.begin) as recorder:
        for message in run.messages():
            recorder.write(message)
    return path


@pytest.fixture(scope="module")
def rrd(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("replay")
    saved = replay(write(folder / "run.mcap", Squeeze(60)), save=folder / "run.rrd")
    assert saved == folder / "run.rrd"
    return saved


def rerun(*arguments: str) -> str:
    done = subprocess.run([viewer(), *arguments], capture_output=True, text=True, timeout=60, check=True)
    return done.stdout + done.stderr


def test_rerun_verifies_the_file(rrd: Path) -> None:
    assert "1 file verified without error" in rerun("rrd", "verify", str(rrd))


def test_everything_is_in_it(rrd: Path) -> None:
    """Regions apart from each other, stress, tools, forces, curves, words; each where a person would look for it."""
    stats = rerun("rrd", "stats", str(rrd))
    for path in (
        "/world/bodies/body/near",
        "/world/bodies/body/far",
        "/world/bodies/body/stress",
        "/world/tools/left",
        "/world/tools/ball",
        "/world/bodies/body/forces/contact",
        "/world/bodies/body/forces/seam",
        "/curves/quantities/grip_force/grip_force",
        "/curves/seam/gap/gap",
        "/curves/energy/stored/strain",
        "/curves/parts/cells/body.near_fem",
        "/curves/speed/rtf/rtf",
        "/summary",
        "/log",
        "/legend/scale",
    ):
        assert f"{path}:" in stats, path
    rows = rerun("rrd", "print", "-v", str(rrd)).count("/world/bodies/body/stress")
    assert rows >= 1


def test_many_bodies_show_what_they_do_to_one_another(tmp_path: Path) -> None:
    """Forces between pairs, one line for all copies where each would have its own, and the same bits again."""
    bodies = {f"cube{k}": cube(0, 1, position=[0.0, 0.0, 0.0502 * k]) for k in range(2)}
    bodies["small"] = cube(1, 2, position=[0.3, 0.0, 0.0], repeat={"grid": [3, 3, 1], "spacing": [0.06, 0.06, 0.06]})
    scene = scene_of(bodies, contacts={"friction": 0.4}, sleep="calm", duration=0.2, quantities=["sag"])
    with softseam.open(scene, record=tmp_path / "run.mcap") as sim:
        sim.run()
    replay(tmp_path / "run.mcap", save=tmp_path / "run.rrd")
    stats = rerun("rrd", "stats", str(tmp_path / "run.rrd"))
    paths = ("/world/pairs", "/curves/parts/cells/11_parts_pbd", "/curves/quantities/sag/small_0_0_0.sag")
    assert all(f"{path}:" in stats for path in paths)
    assert verify(Recording(tmp_path / "run.mcap")).same


def test_a_cut_recording_is_replayed_up_to_the_cut(tmp_path: Path) -> None:
    whole = write(tmp_path / "run.mcap", Squeeze(20, cell=0.025)).read_bytes()
    for i, part in enumerate((0.2, 0.5, 0.95)):
        cut = tmp_path / f"cut{i}.mcap"
        cut.write_bytes(whole[: int(part * len(whole))])
        replay(cut, save=tmp_path / f"cut{i}.rrd")
        rerun("rrd", "verify", str(tmp_path / f"cut{i}.rrd"))


def test_a_hole_is_replayed_around_and_told(tmp_path: Path) -> None:
    run = Squeeze(20, cell=0.025)
    recording = Recording(with_a_bad_chunk(tmp_path / "run.mcap", run.begin, run.messages(), 2))
    (hole,) = recording.holes
    assert 0 < hole.steps < 5 and recording.counts["StepReport"] == 20 - hole.steps
    replay(recording, save=tmp_path / "run.rrd")
    rerun("rrd", "verify", str(tmp_path / "run.rrd"))
    said = rerun("rrd", "print", "-vvv", str(tmp_path / "run.rrd"))
    assert "[recording: the recording is damaged: " in said


def test_a_file_that_cannot_be_written_is_one_clear_error(tmp_path: Path) -> None:
    path = write(tmp_path / "run.mcap", Squeeze(2, cell=0.025))
    with pytest.raises(ReplayError, match=r"ends in \.rrd"):
        replay(path, save=tmp_path / "run.mp4")
    with pytest.raises(ReplayError, match="there is no folder"):
        replay(path, save=tmp_path / "no" / "run.rrd")
    assert [p.name for p in tmp_path.iterdir()] == ["run.mcap"]


def part_of_hue(picture: np.ndarray, tone: tuple[int, int, int]) -> float:
    rgb = picture[..., :3].reshape(-1, 3)
    lit = rgb / np.maximum(np.linalg.norm(rgb, axis=1, keepdims=True), 1e-9)
    wanted = np.array(tone) / np.linalg.norm(tone)
    return float(((lit @ wanted > 0.99) & (rgb.max(axis=1) > 0.2)).mean())


@pytest.mark.viewer
def test_the_view_shows_both_regions_and_the_stress(rrd: Path, tmp_path: Path) -> None:
    """Drawn by the viewer itself, without a display: the body's colours on the left, a wide scale on the right."""
    screenshots(rrd, {tmp_path / "early.png": 0.05, tmp_path / "late.png": 0.5})
    early, late = imread(tmp_path / "early.png"), imread(tmp_path / "late.png")
    height, width = late.shape[:2]
    models = late[int(0.08 * height) : int(0.6 * height), : int(0.4 * width)]
    stress = late[int(0.08 * height) : int(0.6 * height), int(0.41 * width) : int(0.8 * width)]
    assert part_of_hue(models, (205, 90, 50)) > 0.004, "coral"
    assert part_of_hue(models, (75, 110, 155)) > 0.004, "blue"
    assert part_of_hue(stress, (40, 143, 140)) > 0.003, "the scale's middle"
    assert np.abs(early - late).mean() > 0.002, "the body moves"


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def _wait_for(port: int, process: subprocess.Popen[bytes]) -> None:
    """Until the viewer serves its page."""
    deadline = time.monotonic() + 30.0
    while not _listens(port):
        assert time.monotonic() < deadline and process.poll() is None, "the viewer serves no page"
        time.sleep(0.1)  # the pace of asking: the viewer does not say when it is ready


@pytest.fixture
def served(rrd: Path) -> Iterator[tuple[int, int]]:
    """The web viewer's HTTP and gRPC ports."""
    ports = free_port(9090), free_port(9876)
    with running(web_arguments(rrd, *ports), silent=True) as process:
        _wait_for(ports[0], process)
        yield ports


def test_the_web_viewer_listens_on_loopback_only(served: tuple[int, int]) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", served[0], timeout=10)
    connection.request("GET", "/")
    assert connection.getresponse().status == 200
    sockets = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    listening = [one[1].split(":") for one in sockets if one[3] == "0A"]
    mine = {address for address, port in listening if int(port, 16) in served}
    assert mine == {"0100007F"}
    six = Path("/proc/net/tcp6").read_text()
    assert not any(f":{port:04X} " in six for port in served)


def test_sigterm_ends_the_viewer_and_leaves_nothing(tmp_path: Path) -> None:
    """As when a shell or a service manager ends `softseam replay`: no process, no port, no temporary file is left."""
    file, scratch = write(tmp_path / "run.mcap", Squeeze(5)), tmp_path / "tmp"
    scratch.mkdir()
    port = free_port(9090)
    command = [str(Path(sys.executable).with_name("softseam")), "replay", str(file), "--web", "--port", str(port)]
    with subprocess.Popen(command, env={**os.environ, "TMPDIR": str(scratch)}, stdout=subprocess.DEVNULL) as process:
        _wait_for(port, process)
        assert list(scratch.iterdir())
        (child,) = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        process.terminate()
        assert process.wait(20.0) == 128 + signal.SIGTERM
    assert not Path(f"/proc/{child}").exists()
    assert not _listens(port)
    assert not list(scratch.iterdir())


def test_the_viewer_reports_no_usage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It says so itself; where its user asks for it, it is as `rerun analytics` was told to."""

    def reports(environment: dict[str, str]) -> bool:
        done = subprocess.run(
            [viewer(), "analytics", "config"], env=environment, capture_output=True, text=True, timeout=60, check=True
        )
        settings = json.loads(done.stdout)  # null where rerun does not even look, as with CI set
        return settings is not None and bool(settings["analytics_enabled"])

    monkeypatch.delenv("CI", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "own"))
    monkeypatch.delenv(REPORTING, raising=False)
    assert reports(dict(os.environ)), "the control: rerun's own default"
    assert not reports(quiet(tmp_path / "quiet"))
    monkeypatch.setenv(REPORTING, "1")
    assert reports(quiet(tmp_path / "asked"))


@pytest.mark.viewer
def test_chromium_draws_it(served: tuple[int, int], tmp_path: Path) -> None:
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    assert chromium is not None
    url = web_address(*served) + "&renderer=webgl"
    part = 0.0
    with browse(chromium, url, tmp_path / "profile") as page:
        deadline = time.monotonic() + 120.0
        while part < 0.01 and time.monotonic() < deadline:
            (tmp_path / "web.png").write_bytes(page.picture())
            picture = imread(tmp_path / "web.png")
            models = picture[int(0.08 * len(picture)) : int(0.6 * len(picture)), : int(0.4 * picture.shape[1])]
            part = part_of_hue(models, (205, 90, 50)) + part_of_hue(models, (75, 110, 155))
    assert part >= 0.01, "a body is drawn"


# ---- verification -----------------------------------------------------------------------------------------


class Changed(Recording):
    """A recording whose message of one step was changed by the least that a number can change."""

    step = -1

    def __iter__(self) -> Iterator[Recordable]:
        for message in super().__iter__():
            if isinstance(message, Frame) and message.header.step == self.step:
                x = message.x.copy()
                x[0, 0] = np.nextafter(x[0, 0], 1.0)
                message = replace(message, x=x)
            yield message


Simulated = tuple[Begin, list[Recordable]]


@pytest.fixture(scope="module")
def messages() -> Simulated:
    """A real run of 30 steps, FEM and PBD together."""
    scene = Scene.model_validate({**SCENE, "body": {**SCENE["body"], "cell": 0.025}, "duration": 0.3})  # type: ignore[dict-item]
    bundle = Bundle(scene.model_dump_json(), {})
    messages: list[Recordable] = []
    simulation = Simulation(bundle, EmbeddedTransport(), emit=messages.append)
    start = begin(bundle, {"body": simulation.body}, simulation.tools)
    while not simulation.done:
        simulation.step(fields=True)
    simulation.close()
    return start, messages


@pytest.fixture(scope="module")
def simulated(messages: Simulated, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("verify") / "run.mcap"
    with McapRecorder(path, messages[0]) as recorder:
        for message in messages[1]:
            recorder.write(message)
    return path


def test_a_run_is_simulated_again_bit_for_bit(simulated: Path) -> None:
    found = verify(Recording(simulated))
    assert found.same and found.steps == found.frames == 30, found.text
    assert found.text == "all 30 steps and 30 frames are the same, bit for bit"


def test_verification_says_which_step_differs_first(simulated: Path) -> None:
    changed = Changed(simulated)
    changed.step = 17
    found = verify(changed)
    assert not found.same and found.differs_at == 17
    assert found.text.startswith("step 17 is the first that differs: x by up to ")


def test_verification_ends_before_a_hole_and_says_so(messages: Simulated, tmp_path: Path) -> None:
    """Commands of the steps in it are lost, without which none of those behind can be repeated."""
    recording = Recording(with_a_bad_chunk(tmp_path / "run.mcap", *messages, 4))
    (hole,) = recording.holes
    first = round(hole.start / 0.01)
    found = verify(recording)
    assert not found.same and found.steps == found.differs_at == first > 5
    assert f"the {first} steps before it and their {found.frames} frames are the same, bit for bit" in found.text
    assert f"commands of the {hole.steps} steps before step {first + hole.steps} are missing" in found.text
    assert "(" + str(recording.note) + ")" in found.text
