"""The digest of the solvers' sources leaves out only what no simulation in this process loads."""

from __future__ import annotations

import subprocess
import sys
from fnmatch import fnmatch
from pathlib import Path

import pytest

import softseam_protocol
import softseam_services
from softseam.embedded import solver_digest
from softseam_services import source_digest

PROGRAM = """
import sys
from softseam_studies.study.measure import measure, quantity_names
from softseam.scenes import load_scene
for name, length in (("tofu_grasp", 0.05), ("cloth_fold", 0.02), ("sausage", 0.02)):
    found = measure(name, (f"duration={length}",), quantity_names(load_scene(name))[:1], runs=0)
    assert found.status == "done", found.reason
print("\\n".join(name for name in sys.modules if name.startswith("softseam_")))
"""


def sources() -> set[str]:
    """Of the protocol and the services, as 'package/path'."""
    folders = [Path(package.__file__ or "").parent for package in (softseam_protocol, softseam_services)]
    return {
        f"{folder.name}/{path.relative_to(folder).as_posix()}" for folder in folders for path in folder.rglob("*.py")
    }


def apart(names: set[str]) -> set[str]:
    return {name for name in names if any(fnmatch(name, pattern) for pattern in source_digest.APART)}


@pytest.mark.kernels
@pytest.mark.slow
def test_what_is_left_out_is_not_loaded_by_a_simulation() -> None:
    ran = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    modules = {name.replace(".", "/") for name in ran.stdout.split()}
    loaded = {f"{name}{ending}" for name in modules for ending in (".py", "/__init__.py")} & sources()
    assert len(loaded) > 150 and not apart(loaded)


@pytest.mark.parametrize("pattern", source_digest.APART)
def test_all_that_is_left_out_is_there(pattern: str) -> None:
    assert any(fnmatch(name, pattern) for name in sources())


def test_the_digest_changes_with_what_computes_and_not_with_the_bus(monkeypatch: pytest.MonkeyPatch) -> None:
    before, read = solver_digest(), Path.read_bytes

    def edited(name: str) -> str:
        monkeypatch.setattr(Path, "read_bytes", lambda path: read(path) + (b"#" if path.name == name else b""))
        return solver_digest()

    assert edited("peer_links.py") == before != edited("newton.py")
