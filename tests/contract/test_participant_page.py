"""The guide on participants: its program serves as the page says, and the example is as short as the page promises."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from softseam.conform.command import FAILED, NOT_CLAIMED, run_checks, wait_answers
from softseam.conform.examined_part import Service
from softseam_protocol.bus.client import Bus, Router
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.topics import Keys

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/guide/write-a-participant.md").read_text(encoding="utf-8")


@pytest.mark.kernels
def test_the_program_of_the_page_serves_and_fails_what_the_page_says(tmp_path: Path) -> None:
    (program,) = re.findall(r"^```python\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
    (tmp_path / "springs.py").write_text(program)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    command = [sys.executable, str(tmp_path / "springs.py"), "--connect", endpoint]
    with Router(endpoint), subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path) as springs:
        try:
            assert springs.stdout is not None and "answers" in springs.stdout.readline()
            with Bus(endpoint, role=SERVICE) as bus:
                wait_answers(bus, Keys(), "springs")
                rows = run_checks(Service(bus, Keys().participant("springs"), "springs"))
        finally:
            springs.terminate()
    failed = {row.name for row in rows if row.outcome == FAILED}
    (sentence,) = re.findall(r"and fails (.*), for springs", PAGE)
    assert failed == set(re.findall(r"`(\w+)`", sentence)), rows
    assert not [row.name for row in rows if row.outcome == NOT_CLAIMED]


def test_the_example_is_short() -> None:
    files = sorted((ROOT / "clients/softseam/examples/participant").glob("*.py"))
    assert sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files) <= 150
