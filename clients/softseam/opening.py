"""Opens a session; a scene that asks for a tolerance is planned first."""

from collections.abc import Sequence
from pathlib import Path

from softseam.commands import planner
from softseam.scenes import bundle_of
from softseam.session import Session, open_as_given
from softseam.variants import Model, with_settings
from softseam_protocol.scene.scene import Scene


def open(
    scene: str | Path | Scene,
    connect: str | None = None,
    *,
    model: Model | None = None,
    settings: Sequence[str] = (),
    record: str | Path | bool | None = None,
    timeout: float = 120.0,
) -> Session:
    """Open a session on a scene. One with a `tolerance` is planned first, unless it was before or a model is given.

    scene     path of a scene file, the name of a bundled scene ("tofu_grasp"), or a Scene
    connect   endpoint of a router with an orchestrator behind it, e.g. "tcp/127.0.0.1:7447"; None: in this process
    model     name of one, such as fem or pbd, or "hybrid", in place of what the scene says
    settings  "key.key=value", each in place of what the scene says
    record    file to record to (in this process), or True to have the bus's recorder record the session
    timeout   longest wait for an answer over the bus [s]
    """

    def begin(settings: Sequence[str]) -> Session:
        return open_as_given(scene, connect, model=model, settings=settings, record=record, timeout=timeout)

    if model is not None or with_settings(bundle_of(scene)[0], settings).tolerance is None:
        return begin(settings)
    return planner().planned_session(scene, tuple(settings), begin)
