"""Damaged files of compiled kernels, and places where none can be written, cost a compilation and never a run."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from full_disk import files_up_to

from softseam_coupling import kept_kernels

SOURCE = """
from {njit} import njit

@njit(cache=True, error_model="numpy")
def more(x):
    return x + {step}
"""
BOTH = ["softseam_coupling.kept_kernels", "softseam_services.jit.linking"]


class Tiny:
    """A module with one kernel, more(x) = x + step, and the folder in which it is kept."""

    def __init__(self, home: Path, njit: str = BOTH[0]) -> None:
        self._source = home / "tiny.py"
        self._njit = njit
        self.kept = home / "__pycache__"

    def start(self, step: int = 1) -> Any:
        """The kernel as a new process meets it."""
        text, module = SOURCE.format(njit=self._njit, step=step), ModuleType("tiny")
        self._source.write_text(text)
        # an import would take what Python kept of a source as long that was written in the same second
        exec(compile(text, self._source, "exec"), vars(module))
        return module.more

    def file(self, ending: str) -> Path:
        [path] = self.kept.glob(f"tiny.more-*{ending}")
        return path


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> pytest.LogCaptureFixture:
    monkeypatch.setattr(kept_kernels, "_told", set[str]())
    return caplog


def _loaded(kernel: Any) -> int:
    return sum(kernel.stats.cache_hits.values())


def _flip(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda content: b"",
    "cut": lambda content: content[: len(content) // 2],
    "flipped": _flip,
    "zeros": lambda content: bytes(len(content)),
    "of plain numba": lambda content: content[32:],
}


@pytest.mark.kernels
@pytest.mark.parametrize("njit", BOTH)
@pytest.mark.parametrize("ending", [".nbi", ".1.nbc"])
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_file_is_written_anew(
    njit: str, ending: str, damage: str, tmp_path: Path, told: pytest.LogCaptureFixture
) -> None:
    tiny = Tiny(tmp_path, njit)
    assert tiny.start()(1) == 2
    path = tiny.file(ending)
    path.write_bytes(DAMAGES[damage](path.read_bytes()))
    again = tiny.start()
    assert again(1) == 2 and _loaded(again) == 0
    assert [record.args for record in told.records] == [(path,)]
    third = tiny.start()
    assert third(1) == 2 and _loaded(third) == 1
    assert len(told.records) == 1


@pytest.mark.kernels
def test_of_many_damaged_files_one_is_told(tmp_path: Path, told: pytest.LogCaptureFixture) -> None:
    tiny = Tiny(tmp_path)
    more = tiny.start()
    assert (more(1), more(1.5)) == (2, 2.5)
    for path in tiny.kept.glob("*.nbc"):
        path.write_bytes(b"")
    more = tiny.start()
    assert (more(1), more(1.5)) == (2, 2.5) and _loaded(more) == 0
    assert len(told.records) == 1


def test_no_byte_may_change(tmp_path: Path, told: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "file"
    kept_kernels._write(path, ("key", 5))
    whole = path.read_bytes()
    assert kept_kernels._read(path) == ("key", 5)
    for i in range(len(whole)):
        for damaged in (whole[:i], whole[:i] + bytes([whole[i] ^ 1]) + whole[i + 1 :]):
            path.write_bytes(damaged)
            assert kept_kernels._read(path) is None


@pytest.mark.kernels
@pytest.mark.parametrize("ending", [".nbi", ".1.nbc"])
def test_a_file_that_is_missing_is_no_news(ending: str, tmp_path: Path, told: pytest.LogCaptureFixture) -> None:
    tiny = Tiny(tmp_path)
    assert tiny.start()(1) == 2
    tiny.file(ending).unlink()
    again = tiny.start()
    assert again(1) == 2 and _loaded(again) == 0
    assert tiny.file(ending).exists() and told.records == []


@pytest.mark.kernels
def test_code_for_other_types_is_not_taken(tmp_path: Path, told: pytest.LogCaptureFixture) -> None:
    """As when two processes write their entries under one name."""
    tiny = Tiny(tmp_path)
    more = tiny.start()
    assert (more(1), more(1.5)) == (2, 2.5)
    shutil.copy(tiny.file(".2.nbc"), tiny.file(".1.nbc"))
    again = tiny.start()
    assert again(1) == 2 and _loaded(again) == 0
    assert again(1.5) == 2.5 and _loaded(again) == 1
    assert told.records == []


@pytest.mark.kernels
@pytest.mark.parametrize("njit", BOTH)
def test_on_a_full_disk_kernels_stay_in_memory(njit: str, tmp_path: Path, told: pytest.LogCaptureFixture) -> None:
    more = Tiny(tmp_path, njit).start()
    with files_up_to(16):
        assert (more(1), more(1.5)) == (2, 2.5)
    assert list((tmp_path / "__pycache__").glob("tiny.more*")) == []
    assert len(told.records) == 1 and "File too large" in told.text


@pytest.mark.kernels
def test_a_full_disk_brings_no_old_code_back(tmp_path: Path, told: pytest.LogCaptureFixture) -> None:
    """An index has room where an entry has none: it must not name what an older source left."""
    tiny = Tiny(tmp_path)
    assert tiny.start(step=1)(1) == 2
    changed = tiny.start(step=2)
    with files_up_to(tiny.file(".nbi").stat().st_size):
        assert changed(1) == 3
    assert len(told.records) == 1
    assert tiny.start(step=2)(1) == 3


@pytest.mark.kernels
def test_a_folder_that_vanished_is_made_again(tmp_path: Path, told: pytest.LogCaptureFixture) -> None:
    tiny = Tiny(tmp_path)
    more = tiny.start()
    shutil.rmtree(tiny.kept)
    assert more(1) == 2
    assert tiny.file(".nbi").exists() and told.records == []


@pytest.mark.kernels
def test_a_folder_that_can_no_longer_be_written_is_told(tmp_path: Path, told: pytest.LogCaptureFixture) -> None:
    tiny = Tiny(tmp_path)
    more = tiny.start()
    shutil.rmtree(tiny.kept)
    tiny.kept.touch()
    assert (more(1), more(1.5)) == (2, 2.5)
    assert len(told.records) == 1


@pytest.mark.kernels
@pytest.mark.parametrize("njit", BOTH)
def test_without_any_folder_kernels_stay_in_memory(
    njit: str, tmp_path: Path, told: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    tiny = Tiny(tmp_path, njit)
    tiny.kept.touch()
    more = tiny.start()
    assert more(1) == 2 and tiny.start()(1) == 2
    assert len(told.records) == 1


@pytest.mark.kernels
def test_kernels_that_are_moved_are_found(tmp_path: Path) -> None:
    """By a process that looks for them elsewhere: it compiles nothing, and after an edit of the source it does."""
    home, kept = tmp_path / "home", tmp_path / "kept"
    home.mkdir()

    def said(step: int, **where: str) -> str:
        (home / "tiny.py").write_text(SOURCE.format(njit=BOTH[0], step=step))
        program = f"import sys; sys.path.insert(0, {str(home)!r}); import tiny; "
        program += "print(tiny.more(2), len(tiny.more.stats.cache_hits))"
        command = [sys.executable, "-B", "-c", program]
        return subprocess.run(command, env=os.environ | where, stdout=subprocess.PIPE, text=True, check=True).stdout

    assert said(1) == "3 0\n"
    assert kept_kernels.move([home], kept) == 2
    assert not [*home.rglob("*.nb[ic]")]
    assert said(1, NUMBA_CACHE_DIR=str(kept)) == "3 1\n"
    assert said(2, NUMBA_CACHE_DIR=str(kept)) == "4 0\n"
