"""A phase that a force ends holds that force, whatever the step and wherever the tools begin (docs/decisions/30)."""

from __future__ import annotations

from pathlib import Path

import pytest

import softseam
from softseam.observation import Observation
from softseam.variants import Model

WANTED = 4.0
TEXT = """
softseam: 1
name: gel
step: {step}
body:
  shape: {{kind: block, size: [0.04, 0.03, 0.06]}}
  cell: 0.01
  material: {{kind: neo_hookean, young: 30.0e3, poisson: 0.45, density: 1020}}
tools:
  ground: {{kind: plane, point: [0, 0, 0], normal: [0, 0, 1], friction: 0.5}}
  left: {{kind: box, size: [0.01, 0.02, 0.03], position: [-{away}, 0, 0.035], friction: 0.8}}
  right: {{kind: box, size: [0.01, 0.02, 0.03], position: [{away}, 0, 0.035], friction: 0.8}}
motion:
  - {{tools: [left, right], close: 0.03, until: {until}}}
  - {{hold: 0.2}}
quantities: [grip_force, compression]
"""


def _forces(folder: Path, model: Model, step: float, away: float, until: str) -> tuple[list[float], list[str]]:
    """Grip force of each step of the hold [N], and what was told."""
    path = folder / "gel.yaml"
    path.write_text(TEXT.format(step=step, away=away, until=until))
    held, told = list[float](), list[str]()

    def look(observation: Observation) -> None:
        told.extend(f"{event.kind}: {event.message}" for event in observation.events)
        if observation.report.phase == 1:
            held.append(observation.quantities["grip_force"])

    with softseam.open(path, model=model) as session:
        session.reset()
        session.run(look)
    return held, told


@pytest.mark.parametrize("model", ["fem", "pbd"])
@pytest.mark.parametrize(("step", "away"), [(0.01, 0.03), (0.08, 0.0305), (0.08, 0.0315)])
def test_the_force_that_ends_a_phase_is_held(tmp_path: Path, model: Model, step: float, away: float) -> None:
    """In steps of 80 ms, 2.4 mm each finger, it held up to 7.2 N."""
    held, told = _forces(tmp_path, model, step, away, f"{{force: {WANTED}}}")
    assert held[-1] == pytest.approx(WANTED, rel=0.04)
    assert not any(text.startswith("force") for text in told)


def test_a_phase_that_ends_off_its_force_says_so(tmp_path: Path) -> None:
    held, told = _forces(tmp_path, "fem", 0.2, 0.03, f"{{force: {WANTED}, time: 0.4}}")
    assert abs(held[-1] - WANTED) > 0.1 * WANTED
    assert any("motion[0] ends with" in text and "not with the 4 N of until.force" in text for text in told)


def test_tools_that_close_on_one_another_end_the_run(tmp_path: Path) -> None:
    """They passed through each other, and the run went on for ever."""
    with pytest.raises(softseam.SimulationFailed, match=r"motion\[0\]: 'left' and 'right' have met before"):
        _forces(tmp_path, "pbd", 0.05, 0.03, "{force: 4000}")
