"""A second start compiles nothing."""

from __future__ import annotations

import subprocess
import sys
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest
from gradient_cases import grasp, squeeze
from numba import config

import softseam
from softseam.losses import tool_force
from softseam_protocol.messages.participant import Configure, Request
from softseam_protocol.scene.file import scene_from_bundle
from softseam_services import warm_up
from softseam_services.server import ParticipantServer

STEP = """
import gc
from numba.core.dispatcher import Dispatcher
from fem_run import CLOSE, FemRun, tofu

run = FemRun(tofu())
run.step(CLOSE)
run.solver.snapshot()
ours = [d for d in gc.get_objects() if isinstance(d, Dispatcher) and d.__module__.startswith("softseam_services")]
print(*sorted(d.__qualname__ for d in ours if d.stats.cache_misses))
print(sum(sum(d.stats.cache_hits.values()) for d in ours))
"""


@pytest.mark.kernels
@pytest.mark.slow
def test_kernels_of_fem_come_from_the_cache() -> None:
    """Whatever a step of FEM calls from Python is loaded, not compiled, once another process has compiled it."""
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", STEP],
            cwd=Path(__file__).parents[1],
            capture_output=True,
            text=True,
            check=True,
            timeout=300,
        )
    missed, hits = done.stdout.split("\n")[:2]
    assert missed == ""
    assert int(hits) > 0


@pytest.mark.kernels
def test_contact_in_a_pile_is_compiled_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is asked of a participant then has two bodies that may touch, and stand on each other."""
    asked: list[Request] = []
    monkeypatch.setattr(ParticipantServer, "handle", lambda self, request: asked.append(request))
    warm_up.warm_pile("pbd", touching=True)
    configure = asked[0]
    assert isinstance(configure, Configure)
    scene = scene_from_bundle(configure.bundle)
    assert [each.between for each in scene.interfaces.values()] == [("first", "second")]


def test_a_model_is_compiled_ahead_where_it_never_was_and_can_be_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = ModuleSpec("kernels", None, origin=str(tmp_path / "__init__.py"))
    monkeypatch.setattr(warm_up, "find_spec", lambda name: spec)
    monkeypatch.setattr(config, "DISABLE_JIT", 0)
    monkeypatch.setattr(config, "CACHE_DIR", "")
    assert warm_up.never_compiled("fem")
    (tmp_path / "__pycache__").mkdir()
    assert warm_up.never_compiled("fem")
    (tmp_path / "__pycache__" / "step.advance-1.py311.nbi").touch()
    assert not warm_up.never_compiled("fem")
    assert warm_up.never_compiled("fem", "step_derivative") and not warm_up.never_compiled("fem", "step")


@pytest.mark.kernels
@pytest.mark.parametrize(("never", "seen", "told"), [(True, True, True), (True, False, False), (False, True, False)])
def test_the_first_gradient_says_that_it_compiles(
    never: bool, seen: bool, told: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """On a terminal, and once on a machine."""
    asked: list[tuple[str, ...]] = []

    def never_compiled(*names: str) -> bool:
        asked.append(names)
        return never

    monkeypatch.setattr(warm_up, "never_compiled", never_compiled)
    with softseam.open(grasp(0.4)) as sim:
        sim.reset()
        monkeypatch.setattr(sys.stderr, "isatty", lambda: seen)
        asked.clear()
        monkeypatch.setattr(warm_up.Beside, "begin", lambda self, models: set())
        sim.gradient(tool_force("left", [1.0, 0.0, 0.0]), ["young"], commands=squeeze(1))
    assert ("fem", "step_derivative") in asked
    assert ("derivatives of steps" in capsys.readouterr().err) == told


@pytest.mark.parametrize(("setting", "value"), [("DISABLE_JIT", 1), ("CACHE_DIR", "elsewhere")])
def test_nothing_is_compiled_ahead_where_nobody_would_find_it(
    setting: str, value: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = ModuleSpec("kernels", None, origin=str(tmp_path / "__init__.py"))
    monkeypatch.setattr(warm_up, "find_spec", lambda name: spec)
    monkeypatch.setattr(config, setting, value)
    assert not warm_up.never_compiled("fem")


def test_what_cannot_be_compiled_ahead_is_left_to_the_run() -> None:
    with warm_up.Beside() as beside:
        assert beside.begin(["no such model"]) == set()
        beside.wait(["no such model"])
