"""The order of the tests, and what a machine without Docker or a display driver leaves out.

Fast tests come first, then the slow ones, then those that need a Docker engine or draw. On a developer's machine
that lacks a Docker engine, or Vulkan and Chromium, such tests are left out and the last lines say so. With CI=true
nothing is left out, and a test that skips itself has failed.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Generator
from pathlib import Path

import pytest

IN_CI = os.environ.get("CI", "").lower() in {"1", "true"}
ORDER = ("slow", "viewer", "docker")
_left_out: dict[str, int] = {}


def _docker() -> str | None:
    """Why the Docker tests cannot run here, or None."""
    if shutil.which("docker") is None:
        return "no docker command"
    if subprocess.run(["docker", "info"], capture_output=True, timeout=30, check=False).returncode == 0:
        return None
    if os.geteuid() == 0 and shutil.which("dockerd", path=os.environ["PATH"] + ":/usr/sbin"):
        return None  # the tests start an engine of their own
    return "no Docker engine answers"


def _viewer() -> str | None:
    """Why the viewer's tests cannot run here, or None."""
    if not any(Path(folder).glob("*.json") for folder in ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d")):
        return "no Vulkan driver (on Debian: mesa-vulkan-drivers libvulkan1)"
    if shutil.which("chromium") is None and shutil.which("google-chrome") is None:
        return "no Chromium"
    return None


def _cost(item: pytest.Item) -> int:
    cost = max((ORDER.index(mark.name) + 1 for mark in item.iter_markers() if mark.name in ORDER), default=0)
    # a file's services are started once: its fast tests come with its slow ones
    return max(cost, 1) if "services" in getattr(item, "fixturenames", ()) else cost


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Sort the tests by their cost, and leave out what this machine cannot run unless in CI."""
    items.sort(key=_cost)
    if IN_CI:
        return
    for mark, obstacle in (("docker", _docker), ("viewer", _viewer)):
        marked = [item for item in items if item.get_closest_marker(mark)]
        why = obstacle() if marked else None
        if why is not None:
            config.hook.pytest_deselected(items=marked)
            items[:] = [item for item in items if item not in marked]
            _left_out[f"{mark} tests: {why}"] = len(marked)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """In CI a skipped test is a failed one."""
    report = yield
    if IN_CI and report.skipped and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"{item.nodeid} was skipped, which CI does not allow: {report.longrepr}"
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say what was left out."""
    for why, count in _left_out.items():
        terminalreporter.write_line(f"LEFT OUT {count} {why}")
