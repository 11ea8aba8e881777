"""The Python client in this process, on a cube of eight cells between two plates."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from held_cube import CLOSE, SCENE

import softseam
from softseam.embedded import EmbeddedBackend
from softseam.observation import principal_stress, von_mises
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.scene import Scene


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("scene") / "cube.yaml"
    file.write_text(SCENE)
    return file


@pytest.fixture
def sim(path: Path) -> Iterator[softseam.Session]:
    with softseam.open(path) as session:
        yield session


@pytest.mark.kernels
def test_tools_keep_their_names_whatever_order_a_program_gives_them_in() -> None:
    """Scenes travel with sorted keys: forces and poses must not change hands with them."""
    plate = {"kind": "box", "size": [0.01, 0.03, 0.03]}
    scene = Scene.model_validate(
        {
            "softseam": 1,
            "name": "order",
            "duration": 0.1,
            "body": {
                "shape": {"kind": "block", "size": [0.02, 0.02, 0.02]},
                "cell": 0.02,
                "material": {"young": 2e4, "poisson": 0.45, "density": 1000},
            },
            "tools": {"wall": plate | {"position": [0.05, 0.0, 0.01]}, "ground": {"kind": "plane"}},
            "regions": {"default": "fem"},
        }
    )
    with softseam.open(scene) as session:
        obs = session.run()
    assert obs.tools["wall"].position[0] == 0.05
    assert obs.wrench["wall"][2] == 0.0
    assert obs.wrench["ground"][2] == pytest.approx(-1000 * 0.02**3 * 9.81, rel=0.05)


@pytest.mark.kernels
def test_observation_of_a_squeeze(sim: softseam.Session) -> None:
    """Plates that close by 2 x 1 mm push back on a cube with equal and opposite forces; everything is typed and SI."""
    obs = sim.reset(seed=3)
    assert (obs.step, obs.time, obs.grip_force, obs.done) == (0, 0.0, 0.0, False)
    for _ in range(5):
        obs = sim.step(CLOSE)
    assert obs.step == 5
    assert obs.time == pytest.approx(0.05)
    assert obs.tools["left"].position[0] == pytest.approx(-0.0145)
    np.testing.assert_array_equal(obs.tools["right"].velocity, CLOSE["right"])
    assert obs.grip_force > 0.1
    # Newton's third law through the body; what is left over is the body's own acceleration and the ground
    left, right = obs.wrench["left"][0], obs.wrench["right"][0]
    assert left < 0.0 < right
    assert abs(left + right) < 0.05 * right
    assert obs.positions.shape == (125, 3)
    assert obs.cauchy.shape == (8, 8, 6)
    assert obs.von_mises.shape == (8, 8)
    assert obs.principal_stress.shape == (8, 8, 3)
    assert obs.von_mises.max() == pytest.approx(obs.quantities["peak_von_mises"])
    # a point at the rim may touch the ground as well, so only the sum over all tools is theirs
    total = -sum(wrench[:3] for wrench in obs.wrench.values())
    np.testing.assert_allclose(obs.contact_force.sum(axis=0), total, rtol=1e-6, atol=1e-9)
    assert set(obs.contact_tool.tolist()) >= {-1, list(obs.tools).index("right")}
    assert 0.0 <= obs.seam.gap < 1e-3 * 0.01
    assert obs.parts and all(region.model in ("fem", "pbd") for region in obs.parts.values())
    with pytest.raises(ValueError, match="read-only"):
        obs.positions[0, 0] = 1.0
    with pytest.raises(AttributeError):
        obs.time = 1.0  # type: ignore[misc]


@pytest.mark.kernels
def test_whole_numbers_of_numpy_are_whole_numbers(sim: softseam.Session) -> None:
    sim.reset(seed=np.int64(3))  # type: ignore[arg-type]
    assert sim.step(CLOSE, count=np.uint8(2)).step == 2  # type: ignore[arg-type]
    assert sim.run(max_steps=np.int32(3)).step == 5  # type: ignore[arg-type]


@pytest.mark.kernels
def test_the_start_has_the_quantities_that_the_steps_have(path: Path) -> None:
    """A policy's input is as long after `reset` as after a step with fields; without them some are missing."""
    wanted = "quantities=[grip_force, peak_von_mises, tip_deflection, compression, mesh_error]"
    with softseam.open(path, settings=[wanted, "probes={core: [0, 0, 0.01]}"]) as session:
        start = session.reset()
        begun = session.snapshot()
        step = session.step(CLOSE, count=2)
        errors = {"model_error", "mesh_error", "traction_jump"}
        assert set(step.quantities) - set(start.quantities) == errors and step.quantities["compression"] == 0.0
        needs_fields = {"peak_von_mises", "tip_deflection", "core.von_mises", "core.displacement"}
        for seen in (start, session.restore(begun)):
            assert {name: seen.quantities[name] for name in needs_fields} == pytest.approx(
                dict.fromkeys(needs_fields, 0.0), abs=1e-6
            )
        bare = session.step(CLOSE, fields=False)
        assert set(step.quantities) - set(bare.quantities) == needs_fields | errors


@pytest.mark.kernels
def test_run_follows_the_motion(sim: softseam.Session) -> None:
    """`run` resets, follows the scene to its end, and tells every step."""
    seen: list[softseam.Observation] = []
    last = sim.run(seen.append)
    assert sim.done and last.done
    assert [obs.step for obs in seen] == list(range(1, 11))
    assert last.time == pytest.approx(0.1)


@pytest.mark.kernels
@pytest.mark.parametrize("looks", [False, True])
def test_a_run_that_is_cut_short_stands_at_its_last_step(
    sim: softseam.Session, monkeypatch: pytest.MonkeyPatch, looks: bool
) -> None:
    """Whether somebody looks or not, and whatever cuts it short, `last` is the last step that was taken."""
    follow, seen = EmbeddedBackend.follow, list[softseam.Observation]()

    def interrupted(backend: EmbeddedBackend, most: int | None) -> object:
        if backend.simulation.time > 0.025:
            raise KeyboardInterrupt
        return follow(backend, most)

    sim.reset()
    with monkeypatch.context() as patched:
        patched.setattr(EmbeddedBackend, "follow", interrupted)
        with pytest.raises(KeyboardInterrupt):
            sim.run(seen.append if looks else None)
    assert sim.last.step == 3 and [obs.step for obs in seen] == [1, 2, 3][: 3 * looks]
    assert sim.run(max_steps=2).step == sim.last.step == 5
    with pytest.raises(ValueError, match="read-only"):
        sim.last.wrench["left"][0] = 1.0
    assert sim.run().done and sim.run().step == sim.last.step == 10


@pytest.mark.kernels
def test_same_inputs_same_bits(path: Path) -> None:
    """Two sessions, and a reset one, give the same bits."""
    trajectories = []
    with softseam.open(path) as first, softseam.open(path) as second:
        for session in (first, second, first):
            session.reset(seed=1)
            trajectories.append(session.step(CLOSE, count=4).positions.tobytes())
    assert trajectories[0] == trajectories[1] == trajectories[2]


@pytest.mark.kernels
def test_snapshot_continues_bit_for_bit(sim: softseam.Session, path: Path) -> None:
    """What follows a restore is what followed the snapshot, in this session and in another one."""
    sim.reset()
    sim.step(CLOSE, count=3)
    state = sim.snapshot()
    at_snapshot = sim.last
    later = sim.step(CLOSE, count=3)
    again = sim.restore(state)
    assert (again.step, again.time) == (at_snapshot.step, at_snapshot.time)
    assert again.grip_force == at_snapshot.grip_force
    assert sim.step(CLOSE, count=3).positions.tobytes() == later.positions.tobytes()
    with softseam.open(path) as other:
        other.restore(state)
        assert other.step(CLOSE, count=3).positions.tobytes() == later.positions.tobytes()


BAD_VELOCITIES = {
    "unknown tool": ({"lefft": [0, 0, 0]}, softseam.UnknownTool, "left"),
    "two numbers": ({"left": [0.0, 1.0]}, softseam.BadVelocity, "three numbers"),
    "not finite": ({"left": [0.0, float("nan"), 0.0]}, softseam.BadVelocity, "finite"),
    "infinite": ({"left": [0.0, float("inf"), 0.0]}, softseam.BadVelocity, "finite"),
    "words": ({"left": "fast"}, softseam.BadVelocity, "fast"),
    "no mapping": ([0.0, 0.0, 0.0], softseam.BadVelocity, "mapping"),
}


@pytest.mark.kernels
@pytest.mark.parametrize("name", BAD_VELOCITIES)
def test_bad_velocity_changes_nothing(name: str, path: Path) -> None:
    """Bad input is refused by name, and the simulation goes on as if it had not been given."""
    bad, error, words = BAD_VELOCITIES[name]
    with softseam.open(path, model="pbd") as tried, softseam.open(path, model="pbd") as untouched:
        for session in (tried, untouched):
            session.reset(seed=0)
            session.step(CLOSE)
        with pytest.raises(error, match=words):
            tried.step(bad)  # type: ignore[arg-type]
        assert tried.last.step == 1
        assert tried.step(CLOSE).positions.tobytes() == untouched.step(CLOSE).positions.tobytes()


@pytest.mark.kernels
def test_bad_snapshot_changes_nothing(sim: softseam.Session, path: Path) -> None:
    """A damaged snapshot, foreign bytes and another scene's snapshot are refused; the session goes on."""
    sim.reset()
    sim.step(CLOSE)
    good = sim.snapshot()
    with softseam.open(path, settings=["body.material.young=1.0e4"]) as other:
        other.reset()
        foreign = other.snapshot()
    for bad in (b"", b"words", good[:-7], good[:100] + bytes([good[100] ^ 1]) + good[101:], foreign):
        with pytest.raises(softseam.BadSnapshot):
            sim.restore(bad)
    with pytest.raises(softseam.BadInput):
        sim.restore("a path")  # type: ignore[arg-type]
    assert sim.step(CLOSE).step == 2


def test_bytes_that_are_no_scene_are_refused_before_anything_is_compiled() -> None:
    with pytest.raises(softseam.SceneRefused, match="scene"):
        EmbeddedBackend(Bundle("no scene", {}))


@pytest.mark.kernels
def test_bad_calls_are_named(path: Path) -> None:
    with pytest.raises(softseam.SceneRefused, match=r"none\.yaml"):
        softseam.open("folder/none.yaml")
    with pytest.raises(softseam.SceneRefused, match="young"):
        softseam.open(path, settings=["body.material.young=-1"])
    with pytest.raises(softseam.NoConnection, match="softseam up"):
        softseam.open(path, connect="tcp/127.0.0.1:1", timeout=0.5)
    with pytest.raises(softseam.BadInput, match="file name"):
        softseam.open(path, record=True)
    session = softseam.open(path, model="pbd")
    with pytest.raises(softseam.NotReset):
        session.step(CLOSE)
    for seed in (-1, 1.5, "0", True):
        with pytest.raises(softseam.BadInput, match="seed"):
            session.reset(seed)  # type: ignore[arg-type]
    session.reset()
    for count in (0, -1, 2.5, True):
        with pytest.raises(softseam.BadInput, match="count"):
            session.step(CLOSE, count=count)  # type: ignore[arg-type]
    for most in (-1, 2.5, True):
        with pytest.raises(softseam.BadInput, match="max_steps"):
            session.run(max_steps=most)  # type: ignore[arg-type]
    bare = session.step(CLOSE, fields=False)
    with pytest.raises(softseam.FieldsNotObserved, match="fields=True"):
        _ = bare.cauchy
    session.close()
    session.close()
    for use in (session.snapshot, session.reset, session.step):
        with pytest.raises(softseam.SessionClosed):
            use()


@pytest.mark.kernels
@pytest.mark.parametrize("folder", ["/proc/none", "file/folder"])
def test_a_recording_that_has_no_folder_is_bad_input(path: Path, tmp_path: Path, folder: str) -> None:
    (tmp_path / "file").touch()
    where = tmp_path / folder / "run.mcap"
    with softseam.open(path, model="pbd", record=where) as session:
        with pytest.raises(softseam.BadInput, match=f"cannot make the folder of {where}: "):
            session.reset()


@pytest.mark.kernels
def test_a_second_thread_is_told_whose_turn_it_is(sim: softseam.Session) -> None:
    """While the first is at work, which goes on as if nobody had asked; its own calls from within are let through."""
    sim.reset()
    errors: list[BaseException] = []

    def meddle() -> None:
        for use in (sim.step, sim.reset, sim.run, sim.snapshot, sim.estimate_errors, lambda: sim.restore(b"")):
            try:
                use()
            except BaseException as error:
                errors.append(error)

    def progress(_: softseam.Observation) -> None:
        thread = threading.Thread(target=meddle)
        thread.start()
        thread.join()
        assert sim.snapshot()

    assert sim.run(progress, max_steps=1).step == 1
    assert [type(error) for error in errors] == [softseam.BadInput] * 6
    assert all("one thread at a time" in str(error) for error in errors)
    meddler = threading.Thread(target=lambda: errors.append(RuntimeError(sim.step(CLOSE).step)))
    meddler.start()
    meddler.join()
    assert str(errors[-1]) == "2"


def test_stress_measures() -> None:
    """Closed forms: uniaxial s gives s; pure shear t gives sqrt(3) t; principal stresses of both."""
    uniaxial = np.array([7.0, 0, 0, 0, 0, 0])
    shear = np.array([0, 0, 0, 0, 0, 2.0])
    np.testing.assert_allclose(von_mises(np.array([uniaxial, shear])), [7.0, 2.0 * np.sqrt(3.0)], rtol=1e-14)
    np.testing.assert_allclose(principal_stress(uniaxial), [0, 0, 7.0], atol=1e-14)
    np.testing.assert_allclose(principal_stress(shear), [-2.0, 0, 2.0], atol=1e-14)
