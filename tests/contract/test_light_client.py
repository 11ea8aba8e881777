"""The client stays light: importing it loads no solver, and the base install alone can say what is missing."""

from __future__ import annotations

import json
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from softseam.errors import missing_extra

HEAVY = ("numba", "llvmlite", "scipy", "igl", "rerun", "zenoh", "pyarrow", "matplotlib", "meshio", "mcap")

OTHERS = ("softseam_services", "softseam_coupling", "softseam_studies")


def python(code: str, *flags: str) -> str:
    done = subprocess.run(
        [sys.executable, *flags, "-c", textwrap.dedent(code)], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.kernels
def test_import_loads_nothing_heavy() -> None:
    """`import softseam`, and even the names behind `softseam.open`, load neither solvers nor viewers nor the bus
    nor studies."""
    for code in ("import softseam", "import softseam; softseam.open, softseam.Scene, softseam.Observation"):
        loaded = json.loads(python(f"{code}\nimport json, sys; print(json.dumps(sorted(sys.modules)))"))
        assert not [name for name in HEAVY if name in loaded]
        assert not [name for name in loaded if name.startswith(OTHERS)]


@pytest.mark.kernels
def test_import_is_quick() -> None:
    """Less than 0.3 s in a fresh interpreter, the best of three: other work on the machine only adds time."""
    code = """
    from time import perf_counter
    began = perf_counter()
    import softseam
    print(perf_counter() - began)
    """
    assert min(float(python(code)) for _ in range(3)) < 0.3


@pytest.mark.kernels
def test_public_names_exist() -> None:
    """Every name of `__all__` is there, and a name that is not says so."""
    python("""
    import softseam
    for name in softseam.__all__:
        getattr(softseam, name)
    assert set(softseam.__all__) <= set(dir(softseam))
    try:
        softseam.nothing
    except AttributeError as error:
        assert "nothing" in str(error)
    else:
        raise AssertionError
    """)


@pytest.mark.kernels
@pytest.mark.parametrize(
    "arguments", [["run", "tofu_grasp"], ["check", "tofu_grasp"], ["up"], ["serve", "fem"], ["demo"]]
)
def test_missing_solver_is_named(arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without numba whatever needs a solver ends with the command that installs it, not with a traceback."""
    monkeypatch.chdir(tmp_path)
    code = f"""
    import sys
    sys.modules["numba"] = None          # as if it were not installed: importing it raises ModuleNotFoundError
    sys.argv = ["softseam", *{arguments!r}]
    from softseam.cli import main
    sys.exit(main())
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2, done.stderr
    assert "pip install 'softseam[solve]'" in done.stderr
    assert "Traceback" not in done.stderr


def test_house_names_no_registry() -> None:
    """Locks and build files pin packages by hash and name no host, path or local build."""
    root = Path(__file__).parents[2]
    for name in ("requirements.lock", "requirements-dev.lock"):
        lines = (root / name).read_text().splitlines()
        pins = [line for line in lines if line and not line.startswith((" ", "#"))]
        assert len(pins) > 30
        assert not [line for line in pins if "==" not in line or "+" in line]
        assert not [line for line in lines if "://" in line or "index-url" in line or "find-links" in line]
        assert sum("--hash=sha256:" in line for line in lines) >= len(pins)


def test_what_learning_needs_comes_without_what_graphics_cards_need() -> None:
    """Where either is missing, PyTorch for processors alone is named first."""
    for package in ("torch", "stable_baselines3"):
        error = missing_extra(ModuleNotFoundError(name=package), "training")
        first, then = str(error).split(", which is enough, then ")
        assert first.endswith("pip install torch --index-url https://download.pytorch.org/whl/cpu")
        assert then == "pip install 'softseam[learn]'"
