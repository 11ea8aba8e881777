"""Which tests are fast, in which order files come, and what a machine leaves out that lacks Docker or a learner.

Files with the most to do come first, so that no worker is left with one in the end. On a developer's machine a test
that cannot run is skipped, and the last lines count what was left out, with how to have it. With CI=true nothing is
left out, and a test that skips itself has failed.
"""

from __future__ import annotations

import gc
import os
import shutil
import subprocess
import tempfile
from collections import Counter
from collections.abc import Generator
from pathlib import Path

import pytest
from tiers import is_fast, refuse, watched

IN_CI = os.environ.get("CI", "").lower() in {"1", "true"}
LONG = {"docker": 10, "viewer": 3, "slow": 2}
"""how much longer than other tests those with a mark take, roughly"""
LEFT_OUT = os.environ.get("LEFT_OUT", "")
"""a file to which each run of several adds what it left out, for whoever started them all"""


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


def _length(item: pytest.Item) -> int:
    return sum(LONG.get(mark.name, 0) for mark in item.iter_markers())


def pytest_configure(config: pytest.Config) -> None:
    """Routers of tests make keys of their own, which their clients and services find as those of users do."""
    folder = tempfile.TemporaryDirectory(prefix="softseam-keys-")
    config.add_cleanup(folder.cleanup)
    os.environ["SOFTSEAM_KEYS"] = f"{folder.name}/keys"


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """No search for garbage while modules are loaded, and none among them later, where there never is any."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what is fast, sort files by what they take, and skip what this machine cannot run unless in CI."""
    for item in items:
        if is_fast(item):
            item.add_marker("fast")
    lengths = Counter[Path]()
    for item in items:
        lengths[item.path] += _length(item)
    items.sort(key=lambda item: -lengths[item.path])
    if IN_CI:
        return
    for mark, obstacle in (("docker", _docker), ("viewer", _viewer)):
        marked = [item for item in items if item.get_closest_marker(mark)]
        why = obstacle() if marked else None
        if why is not None:
            for item in marked:
                item.add_marker(pytest.mark.skip(reason=why))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """A fast test enters no kernel."""
    if not is_fast(item):
        return (yield)
    with watched(refuse):
        return (yield)


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


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Say what was left out."""
    skipped = [report.longrepr[2].removeprefix("Skipped: ") for report in terminalreporter.stats.get("skipped", ())]
    lines = [f"{count} tests: {why}" for why, count in Counter(skipped).items()]
    for line in lines:
        terminalreporter.write_line(f"LEFT OUT {line}")
    if LEFT_OUT and lines:
        with Path(LEFT_OUT).open("a") as said:
            said.writelines(f"{line}\n" for line in lines)
