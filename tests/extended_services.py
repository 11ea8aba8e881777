"""Services of this machine that know an extension, for tests of what is added from outside."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from softseam_services.bus_options import BusOptions
from softseam_services.launch import UpOptions, supervisor
from softseam_services.supervisor import Supervisor

READY = 300.0
"""until all services are ready, the compilation of every kernel included [s]"""
EXTENSIONS = Path(__file__).parent / "extensions"


@contextmanager
def extended(folder: Path, text: str) -> Iterator[tuple[str, Supervisor]]:
    """Real services that import a module with this text, which may import tests/extensions: their endpoint, and their
    supervisor. Processes that are started meanwhile import it, too."""
    (folder / "known_here.py").write_text(text)
    with socket.create_server(("127.0.0.1", 0)) as probe:
        where = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with pytest.MonkeyPatch.context() as patch:
        for path in (EXTENSIONS.parent, EXTENSIONS, folder):
            patch.setenv("PYTHONPATH", str(path), prepend=os.pathsep)
        patch.setenv("SOFTSEAM_EXTENSIONS", "known_here")
        lines: list[str] = []
        with supervisor(UpOptions(BusOptions(connect=where), folder), lines.append) as services:
            assert services.wait_ready(READY), lines
            yield where, services
