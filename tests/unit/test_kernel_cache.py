"""Compiled kernels are forgotten when any kernel's source changes."""

from __future__ import annotations

from pathlib import Path

from softseam_services.kernel_cache import drop_stale_kernels, kernel_packages


def _package(home: Path, name: str) -> Path:
    folder = home / name / "kernels"
    (folder / "__pycache__").mkdir(parents=True)
    (folder / "caller.py").write_text("from numba import njit\n")
    (folder / "callee.py").write_text("from numba import njit  # 1\n")
    return home / name


def _compile(package: Path) -> Path:
    index = package / "kernels" / "__pycache__" / "caller.f-1.py311.nbi"
    index.write_bytes(b"compiled")
    return index


def test_a_change_anywhere_forgets_everything(tmp_path: Path) -> None:
    packages = [_package(tmp_path, "one"), _package(tmp_path, "two")]
    drop_stale_kernels(packages)
    indexes = [_compile(package) for package in packages]
    assert drop_stale_kernels(packages) == 0
    assert all(index.exists() for index in indexes)
    (packages[1] / "kernels" / "callee.py").write_text("from numba import njit  # 2\n")
    assert drop_stale_kernels(packages) == 2
    assert not any(index.exists() for index in indexes)
    assert drop_stale_kernels(packages) == 0


def test_sources_without_kernels_do_not_count(tmp_path: Path) -> None:
    package = _package(tmp_path, "one")
    drop_stale_kernels([package])
    index = _compile(package)
    (package / "service.py").write_text("print()\n")
    assert drop_stale_kernels([package]) == 0
    assert index.exists()


def test_both_packages_with_kernels_are_watched() -> None:
    assert [folder.name for folder in kernel_packages()] == ["softseam_services", "softseam_coupling"]
