"""What a plan ran beside its scene's sweep is kept as what it is, and known to plans of other tolerances."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from softseam.errors import BadInput
from softseam.scenes import load_scene
from softseam.study.beside import keep, kept
from softseam.study.configurations import Configuration, Fem
from softseam.study.frame import Frame
from softseam.study.measure import Outcome
from softseam.study.series import Series
from softseam.study.store import Identity, Store

FRAME = Frame(load_scene("tofu_push"), np.array([0.06, 0.06, 0.04]))
FOUND = (
    Fem(FRAME, (3, 3, 2), 0.02),
    Fem(replace(FRAME, follows=False), (4, 4, 2), 0.0025, "hex27_reduced", "midpoint", 4.0, ("plate",)),
    Fem(FRAME, (4, 4, 2), 0.0025, grading=(1.0, 2.5, 4.0)),
)
OUTCOME = Outcome("done", series=Series(np.arange(2.0), np.zeros(2), {"sag": np.ones(2)}), walls=(2.5,), simulated=1.0)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path, Identity("scene", "code"), "plan anew")


def test_a_run_is_read_as_what_it_was(store: Store) -> None:
    for fem in FOUND:
        one = fem.configuration()
        store.write(one.key, OUTCOME.as_json())
        keep(store, one)
    read = {one.key: (one, outcome) for one, outcome in kept(store, FRAME)}
    for fem in FOUND:
        one, outcome = read.pop(fem.configuration().key)
        assert one == fem.configuration() and one.fem is not None
        assert (one.fem.family, one.fem.counts, one.fem.step) == (fem.family, fem.counts, fem.step)
        assert outcome.walls == (2.5,) and outcome.series is not None
    assert not read


def test_what_is_no_fem_alone_or_has_no_outcome_is_not_known(store: Store) -> None:
    keep(store, Configuration("xpbd", "XPBD", "xpbd", (), 1.0))
    keep(store, FOUND[0].configuration())
    assert list(kept(store, FRAME)) == []


@pytest.mark.parametrize(
    "change",
    [
        {"counts": [1, 2]},
        {"counts": [4, 4, 4]},
        {"settings": ["step=1"]},
        {"follows": None, "step": "x"},
        {"grading": [1.0, 4.0]},
    ],
)
def test_what_another_version_noted_is_left_out(store: Store, change: dict[str, object]) -> None:
    one = FOUND[0].configuration()
    store.write(one.key, OUTCOME.as_json())
    keep(store, one)
    assert len(list(kept(store, FRAME))) == 1
    store.write(f"beside-{one.key}", (store.read(f"beside-{one.key}") or {}) | change)
    assert not list(kept(store, FRAME))
    store.write(f"beside-{one.key}", {})
    assert not list(kept(store, FRAME))


def test_what_failed_is_left_out_and_what_cannot_be_read_is_refused(store: Store) -> None:
    one = FOUND[0].configuration()
    keep(store, one)
    store.write(one.key, Outcome("failed", "it diverged").as_json())
    assert not list(kept(store, FRAME))
    store.path(one.key).write_text("{")
    with pytest.raises(BadInput, match=f"{one.key}.json is corrupt"):
        list(kept(store, FRAME))
