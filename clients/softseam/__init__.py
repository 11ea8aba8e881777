"""One soft body, two models at once: implicit FEM where fingers touch, XPBD in the far field.

>>> import softseam
>>> with softseam.open("tofu_grasp") as sim:
...     obs = sim.reset(seed=0)
...     while not sim.done:
...         speed = 0.02 if obs.grip_force < 5.0 else 0.0
...         obs = sim.step({"left": [speed, 0, 0], "right": [-speed, 0, 0]})   # tool velocities [m/s]

Names are loaded when they are first used, so that `import softseam` costs a program next to nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from softseam.errors import (
        BadInput,
        BadSnapshot,
        BadVelocity,
        FieldsNotObserved,
        MissingExtra,
        NoConnection,
        NotReset,
        SceneRefused,
        SchemaMismatch,
        ServicesFailed,
        SessionClosed,
        SimulationFailed,
        SoftseamError,
        UnknownTool,
    )
    from softseam.observation import Observation, ToolView
    from softseam.opening import open
    from softseam.scenes import load_scene
    from softseam.session import Session
    from softseam.variants import with_model, with_settings
    from softseam_protocol.scene.scene import Scene

__all__ = [
    "BadInput",
    "BadSnapshot",
    "BadVelocity",
    "FieldsNotObserved",
    "MissingExtra",
    "NoConnection",
    "NotReset",
    "Observation",
    "Scene",
    "SceneRefused",
    "SchemaMismatch",
    "ServicesFailed",
    "Session",
    "SessionClosed",
    "SimulationFailed",
    "SoftseamError",
    "ToolView",
    "UnknownTool",
    "load_scene",
    "open",
    "with_model",
    "with_settings",
]

_HOME = {
    "Observation": "softseam.observation",
    "Scene": "softseam_protocol.scene.scene",
    "Session": "softseam.session",
    "ToolView": "softseam.observation",
    "load_scene": "softseam.scenes",
    "open": "softseam.opening",
    "with_model": "softseam.variants",
    "with_settings": "softseam.variants",
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'softseam' has no attribute {name!r}")
    value = getattr(import_module(_HOME.get(name, "softseam.errors")), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
