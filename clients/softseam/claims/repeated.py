"""What was done in a session, step by step, and the same done again: in its scene, and in its sibling.

A session that is stepped by hand has no sibling beside it. Its claims come of both runs anew, in this process: a run is
repeated bit for bit, and costs what it took; the sibling a part of that.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softseam.claims.beside import reported
from softseam.claims.estimate import compared
from softseam.claims.sibling import NoSibling, sibling_of
from softseam.embedded import EmbeddedBackend
from softseam.report import ReportBuilder
from softseam.session import Session
from softseam_protocol.messages.arrays import Vector3
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene

Command = Mapping[str, Vector3] | None
"""velocities of tools in a step, by name (3,), (6,) or (7,) [m/s, rad/s]; None follows the scene's own motion"""


def claims_of(scene: Scene, bundle: Bundle, seed: int, commands: Sequence[Command]) -> dict[str, Any]:
    """Claims, as in a report, of a run from the scene's start by these commands. Raises NoSibling, SimulationFailed."""
    with Session(scene, bundle, EmbeddedBackend(bundle)) as session:
        sibling = sibling_of(scene, session.reset(seed).frames)
        report = _repeated(session, commands)
    other = bundle_scene(sibling.scene, bundle.files)
    with Session(sibling.scene, other, EmbeddedBackend(other)) as session:
        session.reset(seed)
        alone = report["verdict"]["done"] and not any(commands)  # both follow the scene's own motion to its end
        longer = reported(session) if alone else _repeated(session, resampled(commands, sibling.finer))
    found = {"outcome": longer["verdict"]["outcome"], "quantities": longer["quantities"]}
    return compared(report, found | {"seconds": longer["wall"]["total"]}, sibling)


def resampled(commands: Sequence[Command], finer: bool) -> list[Command]:
    """For steps twice as long the mean of two, or half as long each twice: tools come to the same places. Of an odd
    number the last is left out. Raises NoSibling where one of two follows the scene's own motion alone."""
    if finer:
        return [command for command in commands for _ in range(2)]
    return [_mean(first, then) for first, then in zip(commands[::2], commands[1::2], strict=False)]


def _mean(first: Command, then: Command) -> Command:
    if first is None and then is None:
        return None
    if first is None or then is None:
        raise NoSibling("steps by hand and steps of the scene's own motion share a step that is twice as long")
    found = {}
    for name in {**first, **then}:
        both = [np.resize(each[name], 7) * (np.arange(7) < len(each[name])) for each in (first, then) if name in each]
        size = max(len(each[name]) for each in (first, then) if name in each)
        mean = 0.5 * np.sum(both, axis=0)
        mean[6] = both[-1][6]  # what it holds is no velocity
        found[name] = mean[:size]
    return found


def _repeated(session: Session, commands: Sequence[Command]) -> dict[str, Any]:
    """The report of these steps, from the start."""
    builder = ReportBuilder(session.bundle)
    for command in commands:
        observation = session.step(command, fields=False)
        builder.see(observation)
        if command is None and observation.done:
            break
    report = builder.build()
    report["wall"]["cpu"] = None
    return report
