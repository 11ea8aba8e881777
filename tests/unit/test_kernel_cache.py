"""Compiled kernels are forgotten when a source that they hold code or constants of changes, and only then."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import pytest
from full_disk import files_up_to

from softseam_services import kernel_cache
from softseam_services.kernel_cache import COMPILED_BY, drop_stale_kernels, kernel_packages

_SOURCES = {
    "one/__init__.py": "",
    "one/caller.py": "from numba import njit\nfrom two.callee import kernel\n",
    "one/apart.py": "from numba import njit\n",
    "one/service.py": "import one.caller\n",
    "two/__init__.py": "",
    "two/callee.py": "from numba import njit\nfrom two import sizes\n",
    "two/beside.py": "from numba import njit\nfrom .callee import kernel\n",
    "two/nearby.py": "from numba import njit\nfrom . import sizes\n",
    "two/sizes.py": "LANES = 8\n",
}
_COMPILED = ("one/caller", "one/apart", "two/callee", "two/beside", "two/nearby")


def _index(home: Path, source: str) -> Path:
    folder, name = source.split("/")
    return home / folder / "__pycache__" / f"{name}.kernel-1.py311.nbi"


@pytest.fixture
def home(tmp_path: Path) -> Path:
    for name, text in _SOURCES.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    drop_stale_kernels([tmp_path / "one", tmp_path / "two"])
    for source in _COMPILED:
        _index(tmp_path, source).parent.mkdir(exist_ok=True)
        _index(tmp_path, source).write_bytes(b"compiled")
    return tmp_path


@pytest.mark.parametrize(
    ("changed", "forgotten"),
    [
        ("two/callee.py", {"one/caller", "two/callee", "two/beside"}),
        ("two/sizes.py", {"one/caller", "two/callee", "two/beside", "two/nearby"}),
        ("one/caller.py", {"one/caller"}),
        ("one/apart.py", {"one/apart"}),
        ("one/service.py", set()),
    ],
)
def test_what_a_change_reaches_is_forgotten(home: Path, changed: str, forgotten: set[str]) -> None:
    packages = [home / "one", home / "two"]
    assert drop_stale_kernels(packages) == 0
    (home / changed).write_text((home / changed).read_text() + "# changed\n")
    assert drop_stale_kernels(packages) == len(forgotten)
    assert {source for source in _COMPILED if not _index(home, source).exists()} == forgotten
    assert drop_stale_kernels(packages) == 0


@pytest.mark.parametrize("upgraded", COMPILED_BY)
def test_all_is_forgotten_that_another_compiler_made(
    home: Path, upgraded: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Numba itself looks at its own version alone."""
    monkeypatch.setattr(kernel_cache, "version", lambda name: "9.9" if name == upgraded else version(name))
    assert drop_stale_kernels([home / "one", home / "two"]) == len(_COMPILED)
    assert drop_stale_kernels([home / "one", home / "two"]) == 0


@pytest.mark.parametrize("damaged", [b"", b"{", b"5", b"null", b"[1]", b'{"": 5}', b"\xff"], ids=repr)
def test_without_a_readable_stamp_everything_is_forgotten(home: Path, damaged: bytes) -> None:
    (home / "one" / "__pycache__" / "kernels.json").write_bytes(damaged)
    assert drop_stale_kernels([home / "one", home / "two"]) == len(_COMPILED)


def test_a_full_disk_keeps_no_half_of_a_stamp(home: Path) -> None:
    (home / "one" / "apart.py").write_text("# changed\n")
    with files_up_to(16):
        assert drop_stale_kernels([home / "one", home / "two"]) == 1
    assert [path.name for path in (home / "one" / "__pycache__").glob("kernels*")] == ["kernels.json"]


def test_both_packages_with_kernels_are_watched() -> None:
    assert [folder.name for folder in kernel_packages()] == ["softseam_services", "softseam_coupling"]
