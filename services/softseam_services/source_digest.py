"""Digest of the sources that a simulation's numbers may depend on."""

import hashlib
from fnmatch import fnmatch
from pathlib import Path

import softseam_protocol
from softseam_services.kernel_cache import kernel_packages

APART = (
    "softseam_protocol/bus/*.py",
    "softseam_protocol/publish.py",
    *(f"softseam_protocol/participant/{name}.py" for name in ("handler", "serve")),
    *(f"softseam_protocol/participant/{name}.py" for name in ("part", "part_mesh", "part_solver")),
    *(f"softseam_services/{name}.py" for name in ("__main__", "bus_options", "child", "health", "launch", "lifeline")),
    *(f"softseam_services/{name}.py" for name in ("participant_service", "progress", "supervisor")),
    *(f"softseam_services/orchestrator/{name}.py" for name in ("bus_transport", "client_liveness", "client_session")),
    *(f"softseam_services/orchestrator/{name}.py" for name in ("recorder_feed", "service")),
    "softseam_services/recorder/*.py",
    "softseam_services/checks/*.py",
    *(f"softseam_services/{name}.py" for name in ("described", "source_digest")),
)
"""sources on which no number depends: the bus, processes, others' solvers, recordings, checks"""


def source_digest() -> str:
    """With another digest, perhaps other numbers."""
    digest = hashlib.sha256()
    for package in (*kernel_packages(), Path(softseam_protocol.__file__).parent):
        for path in sorted(package.rglob("*.py")):
            name = f"{package.name}/{path.relative_to(package).as_posix()}"
            if not any(fnmatch(name, apart) for apart in APART):
                digest.update(name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
