"""`up` and `serve` as a user runs them: one terminal, clear errors, nothing left behind."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from real_services import READY, free_port

MODULE = (sys.executable, "-m", "softseam_services")


def run_module(*args: str, timeout: float = READY) -> subprocess.CompletedProcess[str]:
    return subprocess.run((*MODULE, *args), capture_output=True, text=True, timeout=timeout, check=False)


def is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_busy_port_is_named(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        endpoint = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        for command in (["serve", "router"], ["up", "--directory", str(tmp_path)]):
            done = run_module(*command, "--connect", endpoint)
            assert done.returncode == 2, done.stderr
            assert endpoint in done.stderr and "in use" in done.stderr
            assert "Traceback" not in done.stderr


@pytest.mark.parametrize("role", ["fem", "pbd", "orchestrator", "recorder"])
def test_no_router_is_one_clear_error(role: str, tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    done = run_module("serve", role, "--connect", endpoint, "--wait", "0.3", "--directory", str(tmp_path))
    assert done.returncode == 2, done.stderr
    assert f"no router answers at {endpoint}" in done.stderr
    assert "Traceback" not in done.stderr


def test_who_would_listen_to_other_machines_in_the_clear_is_refused(tmp_path: Path) -> None:
    for command in (["serve", "router"], ["up", "--directory", str(tmp_path)]):
        done = run_module(*command, "--connect", "tcp/0.0.0.0:7447")
        assert done.returncode == 2, done.stderr
        assert "run `softseam keys --host NAME`" in done.stderr.splitlines()[-1]


@pytest.mark.slow
def test_it_is_run_for_others_with_one_file_to_hand_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page, step by step: named, started at every address, one file handed out, a run with nothing else."""
    keys, handed, port = tmp_path / "keys", tmp_path / "handed" / "client.key", free_port()
    monkeypatch.setenv("SOFTSEAM_KEYS", str(keys))
    client = (sys.executable, "-m", "softseam")
    said = subprocess.run((*client, "keys", "--host", "lab.example"), capture_output=True, text=True, check=True).stdout
    assert f"hand out {keys / 'client.key'}" in said
    options = ("--connect", f"tls/0.0.0.0:{port}", "--directory", str(tmp_path))
    with subprocess.Popen((*MODULE, "up", *options), stderr=subprocess.PIPE, text=True) as process:
        _ready(process)
        handed.parent.mkdir()
        handed.write_bytes((keys / "client.key").read_bytes())
        handed.chmod(0o600)
        keys.chmod(0)  # nobody looks there
        run = (*client, "run", "tofu_grasp", "--set", "duration=0.05", "--connect", f"tls/localhost:{port}")
        done = subprocess.run(run, capture_output=True, text=True, env=os.environ | {"SOFTSEAM_KEYS": str(handed)})
        assert done.returncode == 0, done.stdout + done.stderr
        keys.chmod(0o700)
        process.send_signal(signal.SIGINT)
        assert process.wait(60.0) == 0


def test_health_without_a_router() -> None:
    done = run_module("health", "--connect", f"tcp/127.0.0.1:{free_port()}", "--wait", "0.3")
    assert done.returncode == 2
    assert "no router answers" in done.stderr and "Traceback" not in done.stderr


def _ready(process: subprocess.Popen[str]) -> tuple[str, list[int]]:
    """What `up` says until all services are ready, and their processes."""
    assert process.stderr is not None
    told = ""
    for line in process.stderr:
        told += line
        if "all services are ready" in line:
            break
    pids = [int(found) for found in re.findall(r"is ready \(pid (\d+)", told)]
    assert len(pids) == 5, told
    return told, pids


@pytest.mark.slow
def test_up_runs_everything_and_ctrl_c_stops_it(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    options = ("--connect", endpoint, "--directory", str(tmp_path))
    with subprocess.Popen((*MODULE, "up", *options), stderr=subprocess.PIPE, text=True) as process:
        told, pids = _ready(process)
        healthy = run_module("health", "--connect", endpoint)
        assert healthy.returncode == 0, healthy.stdout + healthy.stderr
        assert healthy.stdout.count("well") == 5
        process.send_signal(signal.SIGINT)
        assert process.stderr is not None
        rest = process.stderr.read()
        assert process.wait(60.0) == 0, rest
    assert "Traceback" not in told + rest
    assert not any(is_running(pid) for pid in pids)


@pytest.mark.slow
def test_up_ends_with_its_command(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    client = (sys.executable, "-c", "import sys; print('the client runs'); sys.exit(7)")
    done = run_module("up", "--connect", endpoint, "--directory", str(tmp_path), "--", *client)
    assert done.returncode == 7, done.stderr
    assert "the client runs" in done.stdout


ABANDON = """
import os, signal, sys
import softseam
sessions = [softseam.open("tofu_grasp", connect=sys.argv[1], model="pbd") for _ in range(16)]
for session in sessions:
    session.reset()
    session.step()
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.slow
def test_abandoned_sessions_keep_no_orchestrator_alive(tmp_path: Path) -> None:
    """The supervisor is killed, so all services end at once, and nobody answers an orchestrator that says farewell."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with subprocess.Popen(
        (*MODULE, "up", "--connect", endpoint, "--directory", str(tmp_path)), stderr=subprocess.PIPE, text=True
    ) as process:
        _, pids = _ready(process)
        client = subprocess.run((sys.executable, "-c", ABANDON, endpoint), timeout=120.0, check=False)
        assert client.returncode == -signal.SIGKILL
        process.kill()
        end = time.monotonic() + 40.0
        while left := [pid for pid in pids if is_running(pid)]:
            assert time.monotonic() < end, f"{len(left)} services are still there"
            time.sleep(0.1)  # the pace of asking
