"""BatchEnv: many TofuLifts at once that are those of the ordinary session, begin anew as Gymnasium says, and go on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from softseam.errors import BadInput, SceneRefused
from softseam.gym import BatchEnv, Randomise, TofuLift, randomise
from softseam.gym.reward import Grip, Lift, StressConcentration, Term, Touch, Way
from softseam.gym.sight import SEEN

pytestmark = pytest.mark.kernels

FULL: tuple[Term[Grip], ...] = (Lift(), Way(), Touch(), StressConcentration(0.5))


@pytest.fixture
def envs() -> Iterator[BatchEnv]:
    found = BatchEnv(5, reward=FULL)
    yield found
    found.close()


def _press(info: dict[str, Any], force: float = 1.5) -> Any:
    """Close until both pads press with a force [N], then rise."""
    return np.where((info["grip_force"] < force)[:, None], [[0.8, 0.0]], [[0.0, 1.0]])


def _bits(envs: BatchEnv, seed: int, steps: int = 12) -> bytes:
    seen, info = envs.reset(seed=seed)
    found: list[Any] = [seen]
    for _ in range(steps):
        seen, reward, *_, info = envs.step(_press(info))
        found += [seen, reward, info["stress"]]
    return b"".join(each.tobytes() for each in found)


@pytest.mark.parametrize("spreads", [Randomise(), Randomise(friction_field=0.5)], ids=["even", "uneven friction"])
def test_each_is_the_tofu_lift_of_its_seed(spreads: Randomise) -> None:
    """By XPBD in the ordinary session, from touching to the end: what is seen, rewarded and told."""
    envs = BatchEnv(3, reward=FULL, randomise=spreads)
    one = TofuLift(model="xpbd", reward=FULL, randomise=spreads)
    seen, info = envs.reset(seed=40)
    alone, told = one.reset(seed=42)
    np.testing.assert_array_equal(seen[2], alone)
    of_contact = [SEEN.index("left pad in contact"), SEEN.index("right pad in contact")]
    rest = [i for i in range(len(SEEN)) if i not in of_contact]
    ended, steps = False, 0
    while not ended:
        action = _press(info)
        seen, reward, terminated, _, info = envs.step(action)
        alone, own, ended, _, told = one.step(action[2].astype(np.float32))
        np.testing.assert_allclose(seen[2][rest], alone[rest], atol=0.02)
        np.testing.assert_allclose(seen[2][of_contact], alone[of_contact], atol=0.1)  # a few points, just touching
        assert reward[2] == pytest.approx(own, abs=2e-3)
        for name in ("lift_height", "compression", "slip"):
            assert info[name][2] == pytest.approx(told[name], abs=1e-5)
        assert info["stress"][2] == pytest.approx(told["stress"], rel=5e-3)
        assert bool(terminated[2]) == ended
        steps += 1
    assert told["is_success"] and info["is_success"][2] and steps > 20
    one.close()
    envs.close()


def test_pads_that_rise_at_once_have_lifted_nothing() -> None:
    """In the first episode and in those that follow: height counts from rest, not from nowhere."""
    envs, one = BatchEnv(2, reward=FULL, autoreset_mode="SAME_STEP"), TofuLift(model="xpbd", reward=FULL)
    envs.reset(seed=6)
    one.reset(seed=6)
    for _ in range(2):
        over = False
        while not over:
            _, reward, terminated, truncated, info = envs.step(np.tile([0.6, 0.2], (2, 1)))
            _, own, *ends, told = one.step([0.6, 0.2])
            info = info.get("final_info", info)
            over = bool(terminated[0] | truncated[0])
            assert over == any(ends) and reward[0] == pytest.approx(own, abs=2e-2)
            assert info["lift_height"][0] == pytest.approx(told["lift_height"], abs=1e-4)
        one.reset()
    one.close()
    envs.close()


def test_a_piece_that_was_lost_keeps_what_it_slipped_by() -> None:
    """Pads that hardly press rise along it, then open: in the batch as in the ordinary session."""
    envs, one = BatchEnv(2, reward=FULL), TofuLift(model="xpbd", reward=FULL)
    _, info = envs.reset(seed=6)
    one.reset(seed=6)
    held = 0.0
    for step in range(22):
        action = [0.8, 0.0] if info["grip_force"][0] < 0.1 and step < 12 else [-0.2, 0.3] if step < 16 else [-1.0, 0.0]
        _, _, _, _, info = envs.step(np.tile(action, (2, 1)))
        *_, told = one.step(action)
        assert info["slip"][0] == pytest.approx(told["slip"], abs=2e-5)
        if info["grip_force"][0] == 0.0 and step > 16:
            held = held or float(info["slip"][0])
            assert info["slip"][0] == held
    assert held > 1e-4 and info["grip_force"][0] == 0.0
    one.close()
    envs.close()


def test_episodes_know_nothing_of_those_before(envs: BatchEnv) -> None:
    first = _bits(envs, 3)
    for _ in range(30):
        envs.step(np.ones((5, 2)))  # crushed, lifted, begun anew
    assert _bits(envs, 3) == first
    fresh = BatchEnv(5, reward=FULL, threads=2)
    assert _bits(fresh, 3) == first != _bits(fresh, 4)
    fresh.close()


def test_what_ends_begins_anew_as_gymnasium_says() -> None:
    """The next step, the same one, or when it is told to."""
    crush = np.tile([1.0, 0.0], (2, 1))
    ends: dict[AutoresetMode, Any] = {}
    for mode in AutoresetMode:
        envs = gymnasium.make_vec("softseam/TofuLift-v0", 2, autoreset_mode=mode)
        assert envs.metadata["autoreset_mode"] is mode
        envs.reset(seed=0)
        over = np.zeros(2, dtype=bool)
        while not over.any():
            seen, reward, terminated, _, info = envs.step(crush)
            over = terminated
        assert (reward[over] < 0.0).all() and not info["is_success"][over].any()
        ends[mode] = seen, over, info
        if mode is AutoresetMode.NEXT_STEP:
            assert seen[over][:, 0].min() > 0.5
            seen, reward, terminated, _, _ = envs.step(crush)
            assert (seen[over] == 0.0).all() and (reward[over] == 0.0).all() and not terminated[over].any()
        elif mode is AutoresetMode.SAME_STEP:
            assert (seen[over] == 0.0).all() and (info["_final_obs"] == over).all()
            last = np.stack(info["final_obs"][over])
            np.testing.assert_array_equal(last, ends[AutoresetMode.NEXT_STEP][0][over])
            assert (info["final_info"]["compression"][over] > 0.45).all() and (info["compression"][over] == 0.0).all()
        else:
            with pytest.raises(BadInput, match="reset_mask"):
                envs.step(crush)
            anew, _ = envs.reset(options={"reset_mask": over})
            assert (anew[over] == 0.0).all()
            np.testing.assert_array_equal(anew[~over], seen[~over])
            envs.step(crush)
        envs.close()


@pytest.mark.parametrize("several", [True, False])
def test_pads_that_meet_above_a_piece_crush_nothing(several: bool) -> None:
    """They rise above it, then close until they are nearer to each other than half of its width."""
    env: Any = BatchEnv(1, randomise=None) if several else TofuLift(randomise=None)
    env.reset(seed=0)
    info: dict[str, Any] = {}
    for k in range(80):
        action = [0.0, 1.0] if k < 32 else [1.0, 0.0]
        *_, terminated, truncated, info = env.step([action] if several else action)
        assert not terminated
    assert truncated
    assert info["stress"] < 600.0, "it bears its weight alone"
    env.close()


def test_an_environment_is_kept_and_put_back(envs: BatchEnv) -> None:
    """In another place; what follows is the same, with the piece after it."""
    _, info = envs.reset(seed=5)
    for _ in range(25):
        *_, info = envs.step(_press(info))
    other = BatchEnv(7, reward=FULL)
    other.reset(seed=99)
    other.restore(6, envs.snapshot(3))
    for number in range(60):
        action = np.tile([0.0, 1.0] if number < 30 else [1.0, 0.0], (7, 1))
        here: Any = envs.step(action[:5])
        there: Any = other.step(action)
        for mine, other_one in zip(here[:4], there[:4], strict=True):
            np.testing.assert_array_equal(mine[3], other_one[6])
    with pytest.raises(BadInput, match="no snapshot"):
        other.restore(0, envs.snapshot(3) | {"body": b"short"})
    with pytest.raises(BadInput, match="no snapshot"):
        other.restore(0, {"body": envs.snapshot(3)["body"]})
    other.close()


def test_whatever_an_agent_does_stays_finite(envs: BatchEnv) -> None:
    """And told stress below the largest modulus: what goes beyond its own has no shape left, and counts as crushed."""
    random = np.random.default_rng(0)
    envs.reset(seed=1)
    ended = 0
    for _ in range(400):
        action = random.choice([-1.0, 0.0, 1.0], (5, 2)) if random.random() < 0.5 else np.ones((5, 2))
        seen, reward, terminated, truncated, info = envs.step(action)
        ended += int((terminated | truncated).sum())
        assert np.isfinite(seen).all() and np.isfinite(reward).all() and np.isfinite(info["stress"]).all()
        assert envs.observation_space.contains(seen) and reward.min() > -10.0
        assert info["stress"].max() <= 26e3
    assert ended > 10


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"num_envs": 0}, "1 or more"),
        ({"num_envs": 2.5}, "whole number"),
        ({"threads": 0}, "threads"),
        ({"autoreset_mode": "never"}, "NEXT_STEP, SAME_STEP, DISABLED"),
        ({"device": "cuda"}, "leave device out"),
        ({"settings": ["body.material.young=-1"]}, "young"),
        ({"settings": ["body.material.kind=corotated"]}, "neo-Hookean"),
        ({"settings": ["body.material.young=1e9"]}, r"1 ms are too long.*it bears 0\.0.* ms\. Vary young"),
        ({"randomise": Randomise(size=0.7)}, r"1 ms are too long.*smallest"),
        ({"randomise": Randomise(size=0.2), "settings": ["tools.left.size=[0.01, 0.09, 0.09"]}, "tools.left.size"),
    ],
)
def test_what_cannot_be_is_refused(given: dict[str, Any], told: str) -> None:
    with pytest.raises((BadInput, SceneRefused), match=told):
        BatchEnv(**{"num_envs": 1, **given})


@pytest.mark.parametrize(("part", "whole"), [(0.7, True), (1.05, False)])
def test_pieces_are_refused_from_where_they_come_apart_at_rest(
    part: float, whole: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By how much of a block a shear wave goes through in a substep of 1 ms."""
    edge, density, poisson = 0.05 / 3.0, 1050.0, 0.3
    young = 2.0 * (1.0 + poisson) * density * (part * edge / 1e-3) ** 2
    numbers = (f"young={young!r}", f"density={density}", f"poisson={poisson}")
    settings = [f"body.cell=[{edge!r}, {edge!r}, {edge!r}]", *(f"body.material.{number}" for number in numbers)]
    given: dict[str, Any] = {"randomise": None, "autoreset_mode": "SAME_STEP", "settings": settings}
    if not whole:
        with pytest.raises(BadInput, match="too long"):
            BatchEnv(8, **given)
        monkeypatch.setattr(randomise, "OF_A_BLOCK", np.inf)
    envs = BatchEnv(8, **given)
    envs.reset(seed=0)
    ended = np.zeros(8, dtype=np.bool_)
    for _ in range(20):
        ended |= envs.step(np.zeros((8, 2)))[2]
    envs.close()
    assert (~ended).all() if whole else ended.all()


def test_bad_calls_are_named_and_change_nothing(envs: BatchEnv) -> None:
    with pytest.raises(BadInput, match="reset"):
        envs.step(np.zeros((5, 2)))
    envs.reset(seed=2)
    before = [envs.snapshot(i)["body"] for i in range(5)]
    for action, told in ((np.zeros((4, 2)), "5 x 2"), (np.full((5, 2), np.nan), "not finite"), ("close", "5 x 2")):
        with pytest.raises(BadInput, match=told):
            envs.step(action)
    for mask in ([True] * 5 + [False], np.zeros(5, dtype=bool), np.ones(5)):
        with pytest.raises(BadInput, match="reset_mask"):
            envs.reset(options={"reset_mask": mask})
    with pytest.raises(BadInput, match="seeds"):
        envs.reset(seed=[1, 2])
    assert [envs.snapshot(i)["body"] for i in range(5)] == before


def test_a_piece_that_is_lost_ends_its_episode_and_tells_how_it_stood(envs: BatchEnv) -> None:
    """Some random actions in a million leave a piece whose places are no numbers; nobody learns from those."""
    envs.reset(seed=3)
    *_, before = envs.step(np.tile([0.5, 0.0], (5, 1)))
    state = envs.snapshot(1)
    envs.restore(1, state | {"body": np.full(len(state["body"]) // 4, np.nan, np.float32).tobytes()})
    seen, reward, terminated, _, info = envs.step(np.tile([0.5, 0.0], (5, 1)))
    assert terminated.tolist() == [False, True, False, False, False] and reward[1] == -1.0
    assert np.isfinite(seen).all() and all(np.isfinite(value).all() for value in info.values())
    assert info["grip_force"][1] == before["grip_force"][1] and not info["is_success"][1]
    seen, _, terminated, *_ = envs.step(np.tile([0.5, 0.0], (5, 1)))
    assert not terminated.any() and not seen[1, :2].any()  # the next piece
