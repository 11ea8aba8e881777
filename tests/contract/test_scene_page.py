"""docs/reference: the scene of the first page is one; no key or quantity of a scene file goes unexplained."""

from __future__ import annotations

import json
import re
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from softseam.checking import check_scene
from softseam_protocol.quantities import QUANTITIES
from softseam_protocol.scene.file import scene_schema

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "reference" / "scene.md").read_text(encoding="utf-8")
FIRST = (DOCS / "start" / "first-scene.md").read_text(encoding="utf-8")
LISTED = (DOCS / "reference" / "quantities.md").read_text(encoding="utf-8")
LINKED = (
    "../guide/gripping.md",
    "../guide/materials.md",
    "../guide/sheets-and-ropes.md",
    "../concepts/xpbd.md",
    "../concepts/time-integration.md",
    "meshes.md",
    "quantities.md",
)
"""pages that explain the keys of one part"""


@pytest.mark.kernels
def test_the_example_is_checked_without_complaint(tmp_path: Path) -> None:
    found = re.search(r"```yaml\n(.*?)```", FIRST, re.DOTALL)
    assert found
    path = tmp_path / "my_press.yaml"
    path.write_text(found[1], encoding="utf-8")
    console = Console(file=StringIO(), width=200)
    check_scene(str(path), (), console)
    assert isinstance(console.file, StringIO) and "my_press" in console.file.getvalue()


def keys() -> list[str]:
    """Every key that a scene file may have, with the spec that has it."""
    schema = json.loads(scene_schema())
    specs = {"Scene": schema, **schema["$defs"]}
    return [f"{name}.{key}" for name, spec in specs.items() for key in spec.get("properties", {})]


def test_every_key_is_explained_here_or_where_this_page_leads() -> None:
    pages = [PAGE, *((DOCS / "reference" / name).read_text(encoding="utf-8") for name in LINKED if f"]({name}" in PAGE)]
    code = " ".join(text for page in pages for text in re.findall(r"```.*?```|`[^`]+`", page, re.DOTALL))
    missing = [key for key in keys() if not re.search(rf"\b{key.partition('.')[2]}\b", code)]
    assert not missing


@pytest.mark.parametrize("quantity", list(QUANTITIES))
def test_every_quantity_has_its_unit(quantity: str) -> None:
    row = next(line for line in LISTED.splitlines() if line.startswith("|") and f"`{quantity}`" in line)
    assert QUANTITIES[quantity].unit in [unit.strip() for unit in row.split("|")[2].split(",")]
