"""The wheel: what it holds, and that it works without any extra."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.kernels

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built as `pip install` builds it, with the build backend that the lock pins."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*command, "--wheel-dir", str(folder), str(ROOT)], check=True, timeout=120)
    (found,) = folder.glob("*.whl")
    return found


@pytest.mark.slow
def test_contents(wheel: Path) -> None:
    """Nothing generic reaches site-packages; types, scenes and the licence are inside, tests are not."""
    names = zipfile.ZipFile(wheel).namelist()
    top = {name.partition("/")[0] for name in names}
    assert all(name.startswith("softseam") for name in top), top
    packages = {"softseam", "softseam_protocol", "softseam_coupling", "softseam_services", "softseam_studies"}
    assert packages <= top
    for package in packages:
        assert f"{package}/py.typed" in names
    assert "softseam_scenes/tofu_grasp.yaml" in names and "softseam_scenes/references/tofu_grasp.json" in names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert not [name for name in names if "test" in name.lower()]


@pytest.mark.slow
def test_works_installed(wheel: Path, tmp_path: Path) -> None:
    """Installed by itself it finds its own modules and scenes, and `softseam --help` teaches."""
    target = tmp_path / "site"
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(target), str(wheel)]
    subprocess.run(command, check=True, timeout=120)
    environment = {**os.environ, "PYTHONPATH": str(target), "NO_COLOR": "1", "COLUMNS": "100"}
    # -S leaves out site-packages' .pth files, so that the checkout's editable install does not answer instead
    packages = next(path for path in sys.path if path.endswith("site-packages"))

    def softseam(*arguments: str) -> subprocess.CompletedProcess[str]:
        start = (
            f"import sys; sys.path.append({packages!r}); import softseam; "
            f"assert softseam.__file__.startswith({str(target)!r}), softseam.__file__; "
            "from softseam.cli import main; sys.argv[0] = 'softseam'; sys.exit(main())"
        )
        return subprocess.run(
            [sys.executable, "-S", "-c", start, *arguments],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )

    told = softseam("--help")
    assert told.returncode == 0, told.stderr
    assert "softseam demo" in told.stdout and " chart " in told.stdout
    refused = softseam("run", "no_such_scene")
    assert refused.returncode == 2
    assert "tofu_grasp" in refused.stderr
