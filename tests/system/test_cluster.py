"""Work shared out over a Ray cluster of two nodes: the same bits, whoever does it, and nothing lost with a worker.

Needs Ray, which continuous integration installs; elsewhere: pip install 'softseam[learn,ray]'.
"""

from __future__ import annotations

import os
import shutil
import signal
import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from softseam.errors import BadInput, NoConnection, ServicesFailed
from softseam_studies import cluster as sharing
from softseam_studies.cli_learning import Evaluate as Wishes
from softseam_studies.cli_studies import Chart as Charting
from softseam_studies.cluster import share
from softseam_studies.learn.evaluate import evaluate
from softseam_studies.learn.policy import POLICY, Training
from softseam_studies.learn.train import new_learner, vectorised
from softseam_studies.study.chart_command import chart
from softseam_studies.study.configurations import Configuration, Fem
from softseam_studies.study.store import Identity, Store
from softseam_studies.study.study import study_of
from softseam_studies.study.sweep import sweep

SCENES = Path(__file__).parents[2] / "scenes"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_spec("ray") is None and not os.environ.get("CI"), reason="pip install 'softseam[ray]'"),
]


@pytest.fixture(scope="module")
def two_nodes() -> Iterator[Any]:
    """Of a processor each."""
    from ray.cluster_utils import Cluster

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        patch.setenv("PYTHONPATH", str(Path(__file__).parent))  # workers know what is installed, and this file
        cluster = Cluster()
        for _ in range(2):
            cluster.add_node(num_cpus=1, include_dashboard=False, object_store_memory=80_000_000)
        yield cluster
        cluster.shutdown()


@dataclass
class Outage:
    """Ends the second node, from a worker in it; the first node's work lasts until then."""

    first: str
    mark: Path

    def __call__(self, number: int) -> int:
        import ray

        if ray.get_runtime_context().get_node_id() != self.first:
            self.mark.touch()
            os.kill(os.getppid(), signal.SIGKILL)
            signal.pause()  # it ends with its node
        end = time.monotonic() + 60.0
        while not self.mark.exists() and time.monotonic() < end:
            time.sleep(0.05)  # nothing announces a file
        return number * number


def deadly() -> Any:
    os.kill(os.getpid(), signal.SIGKILL)


def answer_otherwise(server: socket.socket) -> None:
    """Whoever gave up, and the next one."""
    for _ in range(2):
        server.accept()[0].sendall(b"HTTP/1.1 400 ")


def spoilt() -> Any:
    raise BadInput("what was given is spoilt")


def test_policies_are_judged_alike_by_any_number_of_workers(two_nodes: Any, tmp_path: Path) -> None:
    training = Training("TofuLift", "ppo", 0, 1, 1, model="fem")
    vector = vectorised(training)
    new_learner(training, vector).save(tmp_path / POLICY)
    vector.close()
    training.write(tmp_path)
    alone, both = (
        evaluate(Wishes(tmp_path, pieces=2, step=0.04, ray=ray), Console(quiet=True))
        for ray in (None, two_nodes.address)
    )
    assert list(alone) == list(both) and (alone["close to 2 N"].ending == "lifted").all()
    for name, judged in alone.items():
        for key, value in vars(judged).items():
            np.testing.assert_array_equal(value, vars(both[name])[key])


def test_charts_are_swept_alike_by_any_number_of_workers(
    two_nodes: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The scene and the mesh that it names lie where workers do not look."""
    for suffix in ("obj", "yaml"):
        shutil.copy(SCENES / f"dumpling.{suffix}", tmp_path)
    monkeypatch.chdir(tmp_path)
    study = study_of("dumpling.yaml", ("duration=0.05",))
    wanted = [Fem(study.frame, study.frame.across(n), 0.01).configuration() for n in (1, 2)]
    wanted.append(Configuration("bad", "FEM", "bad", ("step=5.0",), 1e-3))
    found = []
    for ray in (None, two_nodes.address):
        store = Store(tmp_path / str(ray is None), Identity("scene", "code"), "")
        ended = sweep(study, wanted, store, 60.0, lambda what, rough: lambda done: None, 0, ray=ray)
        assert {path.stem for path in store.folder.glob("*.json")} == {*ended} == {one.key for one in wanted}
        found.append({key: (one.status, one.series and one.series.as_json()) for key, one in ended.items()})
    assert found[0] == found[1] and [status for status, _ in found[0].values()] == ["done", "done", "refused"]


def test_work_that_ends_every_worker_is_given_up(two_nodes: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sharing, "LOSSES", 1)
    with pytest.raises(ServicesFailed, match=rf"2 workers of the Ray cluster at {two_nodes.address} ended"):
        share(two_nodes.address, deadly, [0], print)


def test_what_workers_refuse_is_told(two_nodes: Any) -> None:
    with pytest.raises(BadInput, match=r"^what was given is spoilt$"):
        share(two_nodes.address, spoilt, [0], print)


def test_an_address_that_nobody_answers_at_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sharing, "ANSWER", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(NoConnection, match=rf"{address} \(timed out\): ray start"):
            share(address, spoilt, [0], print)
        server = threading.Thread(target=answer_otherwise, args=(silent,))
        server.start()
        with pytest.raises(NoConnection, match=rf"{address} \(something else is there\)"):
            share(address, spoilt, [0], print)
        server.join()
    with pytest.raises(NoConnection, match=rf"{address} .*refused"):
        share(address, spoilt, [0], print)
    for bad in ("auto", "127.0.0.1", "127.0.0.1:port", ":6379"):
        with pytest.raises(BadInput, match=f"--ray {bad}: give HOST:PORT"):
            share(bad, spoilt, [0], print)
    with pytest.raises(NoConnection, match="no Ray cluster answers"):
        chart(Charting("cantilever", out=tmp_path / "chart", ray=address), Console(quiet=True))
    assert not (tmp_path / "chart").exists()  # no minutes went into a reference


def test_what_a_node_was_at_is_done_anew(two_nodes: Any, tmp_path: Path) -> None:
    """The last test: one node is left."""
    first = two_nodes.head_node.node_id
    told: list[str] = []
    found = share(two_nodes.address, partial(Outage, first, tmp_path / "ended"), range(6), told.append)
    assert found == [number * number for number in range(6)]
    assert told
