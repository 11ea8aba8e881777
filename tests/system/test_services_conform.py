"""The services that come along, and the example, conform: real processes, asked by the command as a user types it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from real_services import Services

from softseam.conform.table import CHECKS
from softseam_protocol.bus.client import Bus

pytestmark = pytest.mark.slow
SOFTSEAM = Path(sys.executable).with_name("softseam")


def conform(services: Services, *options: str) -> subprocess.CompletedProcess[str]:
    command = [str(SOFTSEAM), "conform", services.endpoint, *options]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize("service", ["fem", "pbd"])
def test_the_services_conform(services: Services, bus: Bus, service: str) -> None:
    done = conform(services, "--service", service)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{service} conforms" in done.stdout and done.stdout.count("passed") == len(CHECKS)


def test_the_example_conforms(services: Services, bus: Bus) -> None:
    """In a process of its own, beside the services."""
    command = [sys.executable, "-m", "softseam.examples.participant", "--connect", services.endpoint]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as block:
        try:
            assert block.stdout is not None and "answers" in block.stdout.readline()
            done = conform(services, "--service", "block")
        finally:
            block.terminate()
    assert done.returncode == 0, done.stdout + done.stderr
    assert "block conforms" in done.stdout and done.stdout.count("passed") == len(CHECKS)


def test_a_failed_check_is_exit_code_1(services: Services, bus: Bus) -> None:
    """FEM, asked for a model that it does not run; without a name, the participants that there are."""
    done = conform(services, "--service", "fem", "--model", "pbd")
    assert done.returncode == 1 and "failed" in done.stdout
    done = conform(services)
    assert done.returncode == 2 and "fem, pbd" in done.stderr
