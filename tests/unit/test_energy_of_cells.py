"""The energy of cells that a reply brings is that of where the body is, however it came there."""

from __future__ import annotations

import numpy as np
import pytest
from fem_run import CLOSE, FemRun, tofu

pytestmark = pytest.mark.kernels


def _check(run: FemRun) -> float:
    """That fields have what is found anew; all of it [J]."""
    said = run.solver.fields(run.request().header).cell_energy
    total = run.solver.strain
    assert np.array_equal(said, run.work.energy) and said.sum() == pytest.approx(total, rel=1e-12)
    return float(total)


def test_energies_follow_steps_that_are_taken_taken_back_and_refused() -> None:
    run = FemRun(tofu())
    for _ in range(12):
        run.step(CLOSE)
        _check(run)
    pressed = _check(run)
    run.solver.advance(run.request(CLOSE))
    assert _check(run) > pressed
    run.solver.discard()
    assert _check(run) == pressed
    reply = run.solver.advance(run.request({"left": (np.nan, 0.0, 0.0)}))
    assert reply.status == "refused" and _check(run) == pressed
    run.step(CLOSE)
    run.solver.commit()
    _check(run)
    kept = run.solver.snapshot()
    stood = _check(run)
    run.step(CLOSE)
    run.solver.restore(kept)
    assert _check(run) == stood
