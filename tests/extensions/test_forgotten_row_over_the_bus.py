"""A service whose extension forgot a row ends as it starts and names the table."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

HALF = """
from softseam_protocol.scene.materials import MATERIALS, NeoHookeanMaterial
MATERIALS.add("forgotten", NeoHookeanMaterial)
"""


@pytest.mark.parametrize("role", ["fem", "orchestrator"])
def test_a_service_without_a_row_does_not_start(tmp_path: Path, role: str) -> None:
    (tmp_path / "half.py").write_text(HALF)
    process = subprocess.run(
        [sys.executable, "-m", "softseam_services", "serve", role],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"SOFTSEAM_EXTENSIONS": "half", "PYTHONPATH": str(tmp_path)},
    )
    assert process.returncode == 2
    assert "table of material laws: no row 'forgotten'" in process.stderr
