"""Rows that an extension adds, here and in services of this machine, for tests of what is added from outside."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import pytest

from softseam_services.bus_options import BusOptions
from softseam_services.launch import UpOptions, supervisor
from softseam_services.supervisor import Supervisor

READY = 300.0
"""until all services are ready, the compilation of every kernel included [s]"""
EXTENSIONS = Path(__file__).parent / "extensions"


def add(*modules: ModuleType) -> None:
    """Add what modules of tests/extensions name as ROWS: table, name, row."""
    for module in modules:
        for table, name, row in getattr(module, "ROWS", ()):
            table.add(name, row)


def remove(*modules: ModuleType) -> None:
    """Take them out again."""
    for module in modules:
        for table, name, _ in getattr(module, "ROWS", ()):
            table.remove(name)


@contextmanager
def added(*modules: ModuleType) -> Iterator[None]:
    """These rows are there meanwhile."""
    add(*modules)
    yield
    remove(*modules)


@contextmanager
def without(*modules: ModuleType) -> Iterator[None]:
    """These rows are not there meanwhile."""
    remove(*modules)
    yield
    add(*modules)


@contextmanager
def extended(folder: Path, *modules: str) -> Iterator[tuple[str, Supervisor]]:
    """Real services that know the ROWS of these modules of tests/extensions: their endpoint, and their supervisor.
    Processes that are started meanwhile know them, too."""
    names = ", ".join(modules)
    (folder / "known_here.py").write_text(f"import {names}\nfrom extended_services import add\n\nadd({names})\n")
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
