"""The report of a run: what charts, benchmarks and tests read, built up step by step.

>>> builder = ReportBuilder(recording.bundle, facts=recording.facts)
>>> for message in recording:
...     builder.add(message)
>>> builder.build()["quantities"]["grip_force"]["unit"]
'N'
"""

import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softseam.checks import not_done
from softseam.choice import choices, symmetric, uneven_friction
from softseam.columns import TOTAL, Columns, spent, unit_of
from softseam.observation import Observation
from softseam.outputs import cannot_write, whole
from softseam.verdict import Verdict, judge, with_failures
from softseam_protocol.messages.header import SCHEMA_VERSION
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.messages.session import ErrorEstimate, Event, Frame, StepReport
from softseam_protocol.scene.bodies import AnyBody
from softseam_protocol.scene.file import scene_hash
from softseam_protocol.scene.motion import ClosePhase
from softseam_protocol.scene.scene import Scene

REPORT_VERSION = 2


class ReportBuilder:
    """Collects a run's messages; `build` may be called at any time.

    bundle   the scene that is run
    facts    versions and machine of the process that simulates
    model    'hybrid', 'fem' or 'pbd'; found from the parts where it is not given
    """

    def __init__(self, bundle: Bundle, *, facts: Mapping[str, str] | None = None, model: str | None = None) -> None:
        self._bundle = bundle
        self._scene = Scene.model_validate_json(bundle.scene)
        self._facts, self._model = dict(facts or {}), model
        self._rounding = Rounding(self._scene)
        self.columns = self._no_columns()
        self._events: list[Event] = []
        self._first: StepReport | None = None
        self._done = False
        self._estimate: ErrorEstimate | None = None

    @property
    def verdict(self) -> Verdict:
        """What became of the body so far."""
        failed = {event.header.step for event in self._events if event.kind is EventKind.SOLVER}
        return with_failures(judge(self._scene, self.columns, self._done), len(failed), len(self.columns))

    def add(self, message: StepReport | Event | Frame) -> None:
        """Take one message; frames add nothing. A step that restarts the clock begins the report anew."""
        if isinstance(message, StepReport):
            if len(self.columns) and message.header.step <= self.columns.last("step"):
                self.columns, self._estimate = self._no_columns(), None
            if not len(self.columns):
                self._first = message
            self.columns.add(message)
            self._done = message.done
            self._estimate = message.estimate or self._estimate
        elif isinstance(message, Event):
            self._events.append(message)

    def see(self, observation: Observation) -> None:
        """Take what was seen after a step."""
        for event in observation.events:
            self.add(event)
        self.add(observation.report)

    def build(
        self, *, setup_seconds: float = 0.0, recording: str | None = None, lost: int = 0, note: str | None = None
    ) -> dict[str, Any]:
        """The report as plain data that JSON can hold.

        setup_seconds  wall time before the first step: building, compiling, warming up [s]; no part of the RTF
        recording      the file that the run was recorded to
        lost           messages that the recorder lost
        note           what a reader should know, e.g. that the recording is cut off
        """
        c, verdict = self.columns, self.verdict
        return {
            "report_version": REPORT_VERSION,
            "schema_version": SCHEMA_VERSION,
            "scene": {"name": self._scene.name, "hash": scene_hash(self._bundle), "step": self._scene.step},
            "versions": {k: v for k, v in self._facts.items() if k not in ("machine", "cores")},
            "machine": {k: v for k, v in self._facts.items() if k in ("machine", "cores")},
            "model": self._model or self._found_model(),
            "models": self._choices(),
            "verdict": {"outcome": verdict.outcome, "text": verdict.text, "done": self._done},
            "estimated_error": None if self._estimate is None else asdict(self._estimate),
            "symmetry": symmetric(self._scene),
            "uneven_friction": uneven_friction(self._scene),
            "steps": len(c),
            "simulated_seconds": len(c) * self._scene.step,
            "parts": self._parts(),
            "seam": {
                "worst_gap": {"value": _max(c["gap"]), "unit": "m"},
                "largest_multiplier": {"value": _max(c["multiplier"]), "unit": "N"},
                "work": {"value": _sum(c["energy.seam_work"]), "unit": "J"},
                "n_nodes": _spread(c["seam_nodes"]),
            },
            "exchanges": _spread(c["exchanges"]),
            "wall": self._wall(setup_seconds),
            "quantities": self._quantities(),
            "condition": None,
            "energy": {
                "unit": "J",
                "time": _list(c["time"]),
                "ledger": {name: _list(c[f"energy.{name}"]) for name in c.names("energy.")},
                "balance_error": self._energy_from_nowhere(),
                "damped": self._damped(),
                "largest": _max(c["energy.kinetic"] + c["energy.strain"]),
            },
            "penetration": {"worst": _max(c["penetration"]), "unit": "m"},
            "slip": {"worst": max((_max(c[f"quantity.{name}"]) for name in self._slips()), default=0.0), "unit": "m"},
            "momentum": {"unit": "kg m/s", "values": self._vectors("momentum")},
            "angular_momentum": {"unit": "kg m^2/s", "values": self._vectors("angular_momentum")},
            "not_done": not_done(self._scene, c, self._events, self._done),
            "events": [
                {"time": e.header.time, "step": e.header.step, "kind": e.kind, "message": e.message}
                for e in self._events
            ],
            "recording": {"path": recording, "lost_messages": lost, "note": note},
        }

    def _no_columns(self) -> Columns:
        """The force of two tools that close is their grip's."""
        tools = tuple(self._scene.tools)
        closing = {tool for phase in self._scene.motion if isinstance(phase, ClosePhase) for tool in phase.tools}
        return Columns(self._scene.step, tools, [tool for tool in tools if tool not in closing])

    def _slips(self) -> list[str]:
        return [name for name in self.columns.names("quantity.") if name.rpartition(".")[2] == "slip"]

    def _found_model(self) -> str:
        models = set(self.columns.models.values())
        return models.pop() if len(models) == 1 else "hybrid" if models else "none"

    def _choices(self) -> dict[str, str]:
        """Which model had which cells of each body as the run began, and why."""
        first = self._first
        if first is None:
            return {}
        return choices(self._scene, first.parts, (e for e in self._events if e.header.step <= first.header.step + 1))

    def _parts(self) -> dict[str, Any]:
        return {
            name: {
                "model": model,
                "n_nodes": _spread(self.columns[f"{name}.nodes"]),
                "n_elements": _spread(self.columns[f"{name}.cells"]),
                "iterations": _spread(self.columns[f"{name}.iterations"]),
            }
            for name, model in self.columns.models.items()
        }

    def _wall(self, setup_seconds: float) -> dict[str, Any]:
        c = self.columns
        found = {name: _sum(c[f"seconds.{name}"]) for name in (*spent(), TOTAL)}
        total, median = found[TOTAL], float(np.median(c["seconds.total"])) if len(c) else 0.0
        return {
            "unit": "s",
            **found,
            "setup": setup_seconds,
            "step_median": median,
            "rtf": len(c) * self._scene.step / total if total > 0.0 else None,
            "rtf_median_step": self._scene.step / median if median > 0.0 else None,
        }

    def _quantities(self) -> dict[str, Any]:
        """By name: its values, and whether the scene asks for it; what it does not ask for is always reported.

        Of `final`, `min` and `max` what is rounding is 0.
        """
        c = self.columns
        asked = {*self._scene.asked}
        found = {}
        for name in c.names("quantity."):
            unit, values = unit_of(name), c[f"quantity.{name}"]
            known = values[np.isfinite(values)]
            least = self._rounding.least(unit, known)
            shown = np.where(np.abs(values) <= least, 0.0, values)
            found[name] = {
                "unit": unit,
                "asked": name in asked,
                "time": _list(c["time"]),
                "values": _list(values),
                "measured": len(known),
                "final": _number(shown[-1]),
                "min": _number(np.nanmin(shown)) if len(known) else None,
                "max": _number(np.nanmax(shown)) if len(known) else None,
            }
        return found

    def _energy_from_nowhere(self) -> float:
        """Largest violation of the ledger: energy that appeared from nowhere, dissipation below zero, in all [J]."""
        return _sum(np.maximum(-self.columns["energy.dissipation"], 0.0))

    def _damped(self) -> float:
        """What the integrators took from the motion, in all [J]: swings die out that much sooner than true ones."""
        return _sum(np.maximum(self.columns["energy.dissipation"], 0.0))

    def _vectors(self, name: str) -> list[list[float | None]]:
        axes = [_list(self.columns[f"{name}.{axis}"]) for axis in "xyz"]
        return [list(row) for row in zip(*axes, strict=True)]


def write_report(report: Mapping[str, Any], path: Path | str) -> None:
    """Write JSON, all or nothing: a reader never sees half a report. Raises BadInput where it cannot be written."""
    try:
        write_json(report, Path(path))
    except OSError as error:
        raise cannot_write(path, error) from None


def write_json(document: Mapping[str, Any], path: Path) -> None:
    """The same of any document. Raises OSError."""
    with whole(path) as fresh, fresh.open("w", encoding="utf-8") as stream:
        json.dump(document, stream, indent=1, allow_nan=False)
        stream.write("\n")
        stream.flush()
        os.fsync(stream.fileno())


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _list(values: NDArray[np.float64]) -> list[float | None]:
    return [_number(value) for value in values]


def _max(values: NDArray[np.float64]) -> float:
    known = values[np.isfinite(values)]
    return float(known.max()) if len(known) else 0.0


def _sum(values: NDArray[np.float64]) -> float:
    return float(np.nansum(values)) if len(values) else 0.0


def _spread(values: NDArray[np.float64]) -> dict[str, float]:
    """Least, mean and most over time; a step without a value counts as 0."""
    known = np.nan_to_num(values)
    if not len(known):
        return {"min": 0.0, "mean": 0.0, "max": 0.0}
    return {"min": float(known.min()), "mean": float(known.mean()), "max": float(known.max())}


_NOTHING = 1e-9
"""a strain: the stiffest food, a few millimetres of it, is strained by ten times as much by its own weight; and of the
largest value of a quantity: what is less is rounding beside it"""


class Rounding:
    """Knows, for one scene, from which size on a value says something."""

    def __init__(self, scene: Scene) -> None:
        self._floor: dict[str, float] = {}
        for body in scene.bodies.values():
            for unit, floor in _floors(body).items():
                self._floor[unit] = min(floor, self._floor.get(unit, floor))

    def least(self, unit: str, values: NDArray[np.float64]) -> float:
        """Size below which these values (n,) of one quantity, in this unit, are rounding."""
        return max(self._floor.get(unit, 0.0), _NOTHING * float(np.abs(values).max(initial=0.0)))


def _floors(body: AnyBody) -> Mapping[str, float]:
    """By unit, what a strain of `_NOTHING` makes of a body."""
    length = max(body.own_lengths, default=1.0)  # of a mesh, whose extent its file alone has, a metre
    stiffness = body.strain_force(length)
    return {
        "1": _NOTHING,
        "m": _NOTHING * length,
        "Pa": _NOTHING * stiffness / length**2,
        "N": _NOTHING * stiffness,
        "J": _NOTHING**2 * stiffness * length,
    }
