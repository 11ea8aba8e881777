"""TofuLift: what an agent sees of a piece, what it is rewarded with, how pieces differ, and how episodes end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from episodes import Rule, episode

import softseam
from softseam.gym import Randomise, TofuLift
from softseam.gym.reward import (
    GENTLE,
    Deformation,
    Energy,
    GraspStability,
    Grip,
    Lift,
    Ramp,
    StressConcentration,
    Term,
    Touch,
    Way,
)
from softseam.gym.sight import SEEN
from softseam_protocol.scene.friction_field import FrictionFieldSpec

FULL: tuple[Term[Grip], ...] = (Lift(), Way(), Touch(), StressConcentration(0.5))


@pytest.fixture(scope="module")
def env() -> Iterator[TofuLift]:
    env = TofuLift(reward=FULL)
    yield env
    env.close()


def squeezed(part: float) -> Rule:
    return lambda info: [0.4, 0.0] if info["compression"] < part else [0.0, 0.6]


def pressed(force: float) -> Rule:
    return lambda info: [0.4, 0.0] if info["grip_force"] < force else [0.0, 0.6]


def several(env: TofuLift, rule: Rule, pieces: int = 5) -> tuple[float, float, float]:
    """Mean return, part that was lifted, and mean of the largest stress [Pa]."""
    found = [episode(env, rule, seed) for seed in range(pieces)]
    infos = [info for _, info in found]
    return (
        float(np.mean([total for total, _ in found])),
        float(np.mean([info["is_success"] for info in infos])),
        float(np.mean([info["stress"] for info in infos])),
    )


# ---- what is rewarded


@pytest.mark.kernels
def test_who_lifts_gently_is_rewarded_most(env: TofuLift) -> None:
    """Doing nothing is worth less than any lift, and pressing by 2 N more than squeezing to the same height."""
    nothing, lifted, _ = several(env, lambda info: [0.0, 0.0], 3)
    assert -0.4 < nothing < -0.1 and not lifted
    gentle, at_gentle, stress = several(env, pressed(2.0))
    hard, at_hard, more = several(env, squeezed(0.22))
    assert at_gentle == at_hard == 1.0
    assert stress < 0.6 * more
    assert 2.5 < hard + 0.3 < gentle


@pytest.mark.kernels
def test_on_the_way_to_a_lift_every_phase_pays(env: TofuLift) -> None:
    """Closing, touching and rising each: no valley, as of a reward of stress and height alone, keeps an agent away."""
    _, info = env.reset(seed=1)
    rewards: dict[str, float] = {"closing": 0.0, "touching": 0.0, "rising": 0.0}
    over = False
    while not over:
        phase = "closing" if info["grip_force"] == 0.0 else "touching" if info["grip_force"] < 2.0 else "rising"
        _, reward, terminated, truncated, info = env.step(pressed(2.0)(info))
        rewards[phase] += reward
        over = terminated or truncated
    assert info["is_success"] and min(rewards.values()) > 0.0


@pytest.mark.kernels
def test_rewards_add_up_to_the_potentials(env: TofuLift) -> None:
    """Of a lift: 2 for the height, 1 for success, the air that was there, and the stress that it took."""
    total, info = episode(env, pressed(2.0), seed=1)
    steps = round(info["time"] / 0.04)
    force = float(np.expm1(env.see(env.session.last)[SEEN.index("force of the left pad")]) * 0.3)
    touch = 0.3 * force / (force + 0.3)
    rest = total - 3.0 - touch + 0.5 * info["stress"] / 3e3 + 2e-3 * steps
    air = 0.086 - env.session.scene.body.shape.size[0]  # type: ignore[attr-defined]
    assert rest == pytest.approx(0.3 * air / 0.02, rel=0.25)  # seen along the pads' way, a turned piece is wider


def test_terms_are_changes_of_potentials() -> None:
    one = Grip(lift=0.0, air=0.02, force=0.0, slip=0.0, compression=0.0, stress=0.0, energy=0.0)
    other = Grip(lift=0.015, air=0.0, force=0.3, slip=1e-3, compression=0.2, stress=6e3, energy=2e-3)
    terms: list[Term[Grip]] = [
        Lift(2.0),
        Way(0.3),
        Touch(0.3),
        StressConcentration(0.5),
        Deformation(1.0),
        GraspStability(1.0),
        Energy(1.0),
    ]
    there = [term.of(one, other, 0.0) for term in terms]
    assert there == pytest.approx([1.0, 0.3, 0.15, -1.0, -2.0, -0.2, -2.0])
    assert [term.of(other, one, 0.0) for term in terms] == pytest.approx([-reward for reward in there])
    assert Lift().of(one, replace(other, lift=0.05), 0.0) == 2.0  # no more than the height


@pytest.mark.kernels
def test_a_weight_grows_with_the_steps_of_all_environments() -> None:
    ramp = Ramp(100.0, 300.0, 0.5)
    assert [ramp.at(steps) for steps in (0, 100, 200, 300, 1e9)] == [0.0, 0.0, 0.25, 0.5, 0.5]
    with pytest.raises(softseam.BadInput, match="first"):
        Ramp(300.0, 300.0, 0.5)
    for environments in (1, 100):
        env = TofuLift(reward=[StressConcentration(Ramp(0.0, 1e4, 1.0))], randomise=None, environments=environments)
        total, info = episode(env, pressed(2.0), seed=0)
        env.close()
        steps = round(info["time"] / 0.04)
        share = (1.0 - 2e-3 * steps - total) / (info["stress"] / 3e3)  # the weight at which stress grew, on the mean
        assert 0.0 < share < ramp_at(environments * steps) < 4.0 * share
    calm, stressed = (Grip(0, 0, 0, 0, 0, stress, 0) for stress in (0.0, 3e3))
    assert [GENTLE[-1].of(calm, stressed, steps) for steps in (10e3, 1e6)] == [0.0, -1.0]


def ramp_at(steps: float) -> float:
    return min(steps / 1e4, 1.0)


# ---- what is seen


@pytest.mark.kernels
def test_what_is_seen_is_of_order_one_and_says_what_happens(env: TofuLift) -> None:
    _, info = env.reset(seed=2)
    seen, over = [], False
    while not over:
        now, _, terminated, truncated, info = env.step(pressed(2.0)(info))
        assert now in env.observation_space and now.shape == (len(SEEN),)
        seen.append(now)
        over = terminated or truncated
    columns = dict(zip(SEEN, np.array(seen).T, strict=True))
    assert np.abs(seen).max() < 4.0
    held = columns["force of the left pad"] > 0.5
    assert held.any() and not held[0]
    assert columns["height of the marker"][-1] == pytest.approx(info["lift_height"] / 0.03, abs=0.1)
    assert columns["left pad in contact"][0] == 0.0 and 0.3 < columns["right pad in contact"][-1] <= 1.0
    assert columns["pull"][-1] > 0.5 > abs(columns["pull"][0])
    assert columns["time"][0] == pytest.approx(1 / 80)


@pytest.mark.kernels
def test_forces_are_felt_alike_in_both_models_whatever_the_step() -> None:
    """Means over an action: while the pads close, the force at its end is some three times that of a mean by XPBD."""
    felt, ends = [], []
    for env in (TofuLift(step=0.01), TofuLift(step=0.005), TofuLift(model="xpbd")):
        for seed in (0, 1, 2):
            env.reset(seed=seed)
            while (seen := env.step([1.0, 0.0])[0])[2] == 0.0:
                pass
            seen, *_, info = env.step([0.5, 0.0])
            felt.append(0.3 * np.expm1(min(seen[2], seen[3])))
            ends.append(info["grip_force"])
        env.close()
    fine, finer, xpbd = np.reshape(felt, (3, 3))
    np.testing.assert_allclose(fine, finer, rtol=0.1)
    np.testing.assert_allclose(fine, xpbd, rtol=0.25)
    assert (np.array(ends[:3]) > 1.1 * fine).all()


@pytest.mark.kernels
def test_pads_open_no_wider_than_they_began_and_sink_no_lower(env: TofuLift) -> None:
    """Noise closes as often as it opens: without a stop it would lead away from the tofu."""
    env.reset(seed=0)
    start = {name: view.position for name, view in env.session.last.tools.items()}
    for action in ([-1.0, -1.0], [0.5, 0.3], [-1.0, -1.0]):
        seen, *_ = env.step(action)
    assert seen[:2] == pytest.approx([0.0, 0.0], abs=1e-6)
    for name in ("left", "right"):
        np.testing.assert_allclose(env.session.last.tools[name].position, start[name], atol=1e-9)


@pytest.mark.kernels
def test_an_episode_knows_nothing_of_those_before_it(env: TofuLift) -> None:
    """In an environment that was crushed and lifted with, and in a fresh one: the same bits."""
    fresh, found = TofuLift(reward=FULL), []
    for each in (env, fresh):
        seen, _ = each.reset(seed=7)
        rows = [seen]
        for action in ([1.0, 0.0], [0.5, 0.0], [0.4, 0.0]) * 8 + ([0.0, 0.6],) * 6:
            seen, reward, *_ = each.step(action)
            rows.append(np.array([*seen, reward]))
        found.append(np.concatenate(rows))
    fresh.close()
    assert (found[0] == found[1]).all()


# ---- how episodes end


@pytest.mark.kernels
def test_what_is_crushed_ends_the_episode(env: TofuLift) -> None:
    env.reset(seed=0)
    terminated = False
    while not terminated:
        _, reward, terminated, truncated, info = env.step([1.0, 0.0])
        assert not truncated
    assert not info["is_success"] and reward < -1.0
    assert "failed" in info or info["compression"] >= 0.5


@pytest.mark.kernels
def test_a_step_without_a_solution_counts_as_crushed(env: TofuLift, monkeypatch: pytest.MonkeyPatch) -> None:
    env.reset(seed=0)

    def fails(*_: object, **__: object) -> None:
        raise softseam.SimulationFailed("no")

    monkeypatch.setattr(type(env.session), "step", fails)
    _, reward, terminated, truncated, info = env.step([0.4, 0.0])
    assert (reward, terminated, truncated, info["is_success"]) == (-1.0, True, False, False)


# ---- how pieces differ


@pytest.mark.kernels
def test_pieces_differ_within_their_spreads_and_seeds_bring_them_back() -> None:
    env = TofuLift(randomise=Randomise(young=0.2, size=0.1), settings=["body.material.young=40e3"])
    first: list[list[float]] = []
    again: list[list[float]] = []
    for found in (first, again):
        env.reset(seed=5)
        for _ in range(4):
            scene = env.session.scene
            material = scene.body.material  # type: ignore[attr-defined]
            pads = [scene.tools[name].friction for name in ("left", "right", "ground")]
            found.append([material.young, material.poisson, *scene.body.shape.size, *pads])  # type: ignore[attr-defined]
            env.reset()
    env.close()
    young, poisson, length, *_, left, right, ground = np.array(first).T
    assert first == again
    assert np.ptp(young) > 4e3 and (np.abs(young / 40e3 - 1.0) <= 0.2).all()
    assert np.ptp(poisson) > 0.01 and (poisson >= 0.315).all() and (poisson <= 0.4725).all()
    assert np.ptp(length) > 1e-3 and (np.abs(length / 0.05 - 1.0) <= 0.1).all()
    assert (left == right).all() and np.ptp(left) > 0.05 and (left != ground).all()


@pytest.mark.parametrize(
    ("spreads", "key"),
    [(Randomise(young=0.0), "body.material.young"), (Randomise(friction_field=0.4), "body.friction_field")],
)
def test_a_spread_of_one_thing_changes_nothing_else(spreads: Randomise, key: str) -> None:
    random = [np.random.default_rng(3) for _ in range(2)]
    env = TofuLift(randomise=None)
    other, usual = (
        dict(text.split("=", 1) for text in each.settings(env.scene, ("left", "right"), numbers))
        for each, numbers in zip((spreads, Randomise()), random, strict=True)
    )
    assert {name for name in other if other[name] != usual.get(name)} == {key}
    assert random[0].random() == random[1].random()


def test_each_piece_has_friction_of_its_own_whatever_the_order() -> None:
    """By the environment's seed and the episode's number, within the lengths that are asked for."""
    spreads = Randomise(friction_field=0.4, friction_length=(0.01, 0.02))
    scene = TofuLift(randomise=None).scene

    def episodes(seed: int) -> list[FrictionFieldSpec]:
        random, found = np.random.default_rng(seed), []
        for _ in range(3):
            drawn = spreads.draw(scene, ("left", "right"), random).friction_field
            assert drawn is not None and drawn.spread == 0.4 and 0.01 <= drawn.length <= 0.02
            found.append(drawn)
        return found

    first = [episodes(seed) for seed in (5, 6)]
    assert [episodes(seed) for seed in (6, 5)] == first[::-1]
    every = [field for each in first for field in each]
    assert len({field.seed for field in every}) == len({field.length for field in every}) == 6


def test_a_scene_keeps_its_own_friction_where_none_is_drawn() -> None:
    settings = ["body.friction_field={spread: 0.2, length: 0.03, seed: 7}"]
    env = TofuLift(settings=settings)
    assert Randomise().draw(env.scene, ("left", "right"), np.random.default_rng(0)).friction_field == FrictionFieldSpec(
        spread=0.2, length=0.03, seed=7
    )
    env.close()


@pytest.mark.parametrize(
    "spread",
    [
        {"friction_field": 1.5},
        {"friction_length": (0.02, 0.01)},
        {"young": -0.1},
        {"size": 1.0},
        {"poisson": (0.4, 0.3)},
        {"poisson": (0.3, 0.5)},
        {"yaw": 90.0},
    ],
)
def test_a_spread_that_is_none_is_refused(spread: dict[str, Any]) -> None:
    with pytest.raises(softseam.BadInput, match=next(iter(spread))):
        Randomise(**spread)


def test_pieces_that_substeps_cannot_take_are_refused_by_xpbd_alone() -> None:
    stiff = ["body.material.young=1e9"]
    with pytest.raises(softseam.BadInput, match=r"substeps of 1 ms are too long.*model='fem' takes any"):
        TofuLift(model="xpbd", settings=stiff)
    TofuLift(settings=stiff).close()


@pytest.mark.parametrize("given", [{"step": 0.03}, {"step": 0.0}, {"environments": 0}])
def test_what_cannot_be_an_environment_is_refused(given: dict[str, Any]) -> None:
    with pytest.raises(softseam.BadInput, match=next(iter(given))):
        TofuLift(**given)
