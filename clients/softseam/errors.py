"""Everything that a user of the client can run into: each says what is wrong and what to do about it.

`except softseam.SoftseamError` catches them all. Bad input is refused before anything has changed, so the session
goes on as if the call had not been made.
"""

import difflib
from collections.abc import Iterable
from importlib.util import find_spec


class SoftseamError(Exception):
    """Base of everything below; its text is one sentence for a user."""


class SceneRefused(SoftseamError):
    """A scene, or a file that it names, cannot be simulated; the text names file, line, key and remedy."""


class BadInput(SoftseamError, ValueError):
    """A value given to the client is not usable; nothing has changed."""


class UnknownTool(BadInput):
    """A tool is named that the scene does not have."""


class BadVelocity(BadInput):
    """No step can be taken with a tool's velocity; the text says what to give."""


class BadSnapshot(BadInput):
    """Bytes given to `restore` are not a snapshot of this scene."""


class FieldsNotObserved(SoftseamError, AttributeError):
    """A field was read from an observation that was taken without fields."""


class SessionClosed(SoftseamError):
    """The session was closed, and something was asked of it."""


class NotReset(SoftseamError):
    """The session was asked for something before the first `reset`."""


class NoConnection(SoftseamError, ConnectionError):
    """No router, or nobody behind it, answers."""


class ServicesFailed(NoConnection):
    """Services that did answer do so no longer, or those started here never became ready."""


class SchemaMismatch(SoftseamError):
    """The two sides speak different versions of the message schema."""


class SimulationFailed(SoftseamError):
    """The simulation could not go on; the text says where it stopped and what to try."""


class MissingExtra(SoftseamError, ImportError):
    """A part of softseam that is not installed is needed; the text says how to install it."""


def not_among(name: str, known: Iterable[str]) -> str:
    """A name that is none of those known, what it may have been meant to be, and which there are."""
    names = list(known)
    near = difflib.get_close_matches(name, names, 1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return f"{name!r}{hint} (there are: {', '.join(names) or 'none'})"


EXTRA_OF = {
    "numba": "solve",
    "llvmlite": "solve",
    "scipy": "solve",
    "manifold3d": "solve",
    "meshio": "solve",
    "mcap": "solve",
    "zstandard": "solve",
    "rerun": "view",
    "pyarrow": "view",
    "matplotlib": "view",
    "gymnasium": "gym",
    "embreex": "camera",
    "stable_baselines3": "learn",
    "torch": "learn",
    "ray": "ray",
}
PROCESSORS_ALONE = "pip install torch --index-url https://download.pytorch.org/whl/cpu"
"""PyTorch's own way to a build without what graphics cards need: gigabytes, which PyPI's for Linux brings"""


def missing_extra(error: ImportError, purpose: str) -> ImportError:
    """The error to raise where an import failed: a MissingExtra if a package of an extra is absent, else itself."""
    absent = (error.name or "").partition(".")[0]
    extra = EXTRA_OF.get(absent)
    if extra is None or not isinstance(error, ModuleNotFoundError):
        return error
    return _missing(purpose, absent, extra)


def require_extra(extra: str, purpose: str) -> None:
    """Raise MissingExtra where a package of an extra is not installed; imports nothing."""
    for package, needed_by in EXTRA_OF.items():
        if needed_by == extra and find_spec(package) is None:
            raise _missing(purpose, package, extra)


def _missing(purpose: str, package: str, extra: str) -> MissingExtra:
    first = f"{PROCESSORS_ALONE}, which is enough, then " if extra == "learn" else ""
    return MissingExtra(f"{purpose} needs {package}, which is not installed: {first}pip install 'softseam[{extra}]'")
