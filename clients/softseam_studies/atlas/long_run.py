"""A hundred thousand steps of a grasp that is held, with each model: does anything drift, or end as not a number?"""

from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from softseam.errors import SoftseamError
from softseam.observation import Observation
from softseam.report import write_json
from softseam.session import open_as_given
from softseam_protocol.facts import machine
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.scene.scene import Scene
from softseam_studies.atlas.scenes import MODELS, Model, press
from softseam_studies.study.store import Store

PREFIX = "long"
"""of the files' names"""
N_STEPS = 100_000
WINDOW = 1_000
"""steps whose mean is compared, after the first settling and at the end"""


@dataclass(frozen=True)
class LongRun:
    """What became of one model's hold."""

    model: str
    steps: int
    force: float
    """of the grip at the end [N]"""
    drift: float
    """change of its mean between the start of the hold and the end [1]"""
    ripple: float
    """largest distance of the force from the mean of the first window, over that [1]"""
    sunk: float
    """how far the body sank between the plates [m]"""
    kinetic: float
    """largest kinetic energy in the last window over the strain energy [1]"""
    gap: float
    """largest at the seam [m]"""
    finite: bool
    events: int
    safeguards: int
    """events that stand for one"""
    cpu: float
    """processor time [s]"""

    @property
    def sound(self) -> bool:
        """Whether nothing drifted and nothing broke."""
        return self.finite and abs(self.drift) < 0.01 and self.ripple < 0.05 and abs(self.sunk) < 1e-3


def held(model: Model, n_steps: int) -> Scene:
    """The defaults of tofu_grasp on a small cube: gripped by a tenth in the air and held against its weight."""
    scene = press(2e4, 0.01, model, squeeze=0.1, speed=0.01, friction=0.6, poisson=0.45, cells=1)
    scene |= {"gravity": [0, 0, -9.81], "duration": n_steps * 0.01, "quantities": ["grip_force", "lift_height"]}
    return Scene.model_validate(scene)


def hold(model: Model, n_steps: int, console: Console) -> LongRun:
    """Simulate one model's hold; a line of progress a minute of it."""
    forces, heights = np.full(n_steps, np.nan), np.full(n_steps, np.nan)
    kinetic, strain, gap = np.full(n_steps, np.nan), 1e-12, 0.0
    events: list[str] = []
    began, shown = process_time(), perf_counter()

    def see(observation: Observation) -> None:
        nonlocal strain, gap, shown
        i = observation.step - 1
        forces[i], heights[i] = observation.grip_force, observation.lift_height
        kinetic[i], strain = observation.energies["kinetic"], observation.energies["strain"]
        gap = max(gap, observation.seam.gap)
        events.extend(event.kind for event in observation.events)
        if perf_counter() - shown > 10.0:
            shown = perf_counter()
            console.print(f"{MODELS[model]}: {observation.step:,} of {n_steps:,} steps", highlight=False)

    with open_as_given(held(model, n_steps)) as session:
        session.reset()
        session.run(see)
    window = min(WINDOW, n_steps // 4)
    first = forces[window : 2 * window]
    start, end = float(first.mean()), float(forces[-window:].mean())
    return LongRun(
        MODELS[model],
        n_steps,
        end,
        end / start - 1.0,
        float(np.abs(forces[window:] / start - 1.0).max()),
        float(heights[window] - heights[-1]),
        float(kinetic[-window:].max() / strain),
        gap,
        bool(np.isfinite(forces).all() and np.isfinite(kinetic).all()),
        len(events),
        sum(kind in (EventKind.STEP, EventKind.SEAM, EventKind.CELLS) for kind in events),
        process_time() - began,
    )


def long_run(store: Store, folder: Path, console: Console, n_steps: int = N_STEPS) -> list[LongRun]:
    """All models; writes long.json, and prints the figures."""
    runs = []
    for model in MODELS:
        key = f"{PREFIX}-{model}-{n_steps}"
        data = store.read(key)
        run = LongRun(**data) if data is not None else hold(model, n_steps, console)
        if data is None:
            store.write(key, asdict(run))
        runs.append(run)
    table = Table(box=None, padding=(0, 1), title=f"a grasp held for {n_steps:,} steps of 10 ms", title_justify="left")
    for name in ("model", "force", "drift", "ripple", "sank", "K/U", "gap", "acted", "CPU", "sound"):
        table.add_column(name, no_wrap=True)
    for run in runs:
        table.add_row(*cells(run))
    console.print(table)
    document: dict[str, Any] = {"machine": machine(), "runs": [asdict(run) | {"sound": run.sound} for run in runs]}
    try:
        write_json(document, folder / "long.json")
    except OSError as error:
        raise SoftseamError(f"cannot write {error.filename or folder}: {error.strerror}") from error
    console.print(f"{folder / 'long.json'}", highlight=False, soft_wrap=True)
    return runs


def cells(run: LongRun) -> tuple[str, ...]:
    """One row of the table."""
    return (
        run.model,
        f"{run.force:.4f} N",
        f"{100 * run.drift:+.2g} %",
        f"{100 * run.ripple:.2g} %",
        f"{1e6 * run.sunk:.3g} um",
        f"{run.kinetic:.1e}",
        f"{1e6 * run.gap:.2g} um",
        str(run.safeguards),
        f"{run.cpu:.0f} s",
        "yes" if run.sound else "NO",
    )
