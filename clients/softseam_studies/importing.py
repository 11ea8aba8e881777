"""`softseam import`: the two configuration templates of the textbook chapter (9.12) become scenes.

A template says how to solve and nothing of what: body, tools and motion of the scene are assumed. What a template says
is checked as the scene's key that it becomes; what has no equal is listed line by line.
"""

import difflib
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import yaml
from rich.console import Console
from rich.table import Table
from rich.text import Text

from softseam.errors import BadInput, SceneRefused
from softseam.outputs import cannot_write, check_outputs, write_whole
from softseam_protocol.models import NEAR_DEFAULT, PARTICLES_DEFAULT
from softseam_protocol.scene import marked_yaml
from softseam_protocol.scene.file import MAX_SCENE_BYTES, SceneError, parse_scene
from softseam_protocol.scene.models import CLASSIC_PBD


@dataclass(frozen=True)
class _Template:
    """What becomes of a template.

    equal    its keys, and the scene's keys that they become
    without  its keys that no scene has, and what to do instead
    assumed  what the scene has and the template does not say
    """

    equal: Mapping[str, tuple[str, ...]]
    without: Mapping[str, str]
    assumed: Mapping[str, Any]

    @property
    def keys(self) -> list[str]:
        return [*self.equal, *self.without]


_FEM = _Template(
    equal={
        "element_type": ("models.fem.element",),
        "material.model": ("body.material.kind",),
        "material.youngs_modulus": ("body.material.young",),
        "material.poisson_ratio": ("body.material.poisson",),
        "material.density": ("body.material.density",),
        "time_integration.method": ("models.fem.integrator",),
        "time_integration.timestep": ("step",),
    },
    without={
        "solver.type": "matrices are factored, not iterated on: nothing to set",
        "solver.preconditioner": "a factor needs none: nothing to set",
        "solver.tolerance": "a factor solves to rounding; where Newton's method stops, models.fem.tolerance says",
        "solver.max_iterations": "a factor needs none; those of Newton's method are models.fem.iterations",
        "time_integration.adaptive": "a step that does not converge is always divided; models.fem.step_error bounds "
        "errors in time, too, and takes far longer while tools press",
    },
    assumed={
        "gravity": [0, 0, -9.81],
        "step": 0.01,
        "body": {
            "shape": {"kind": "block", "size": [0.04, 0.04, 0.03]},
            "cell": 0.01,
            "material": {"density": 1000},
        },
        "tools": {
            "bottom": {"kind": "box", "size": [0.06, 0.06, 0.01], "position": [0, 0, -0.005], "friction": 0.5},
            "top": {"kind": "box", "size": [0.06, 0.06, 0.01], "position": [0, 0, 0.036], "friction": 0.5},
        },
        "motion": [{"tools": ["bottom", "top"], "close": 0.02, "until": {"compression": 0.1}}, {"hold": 0.05}],
        "regions": {"default": NEAR_DEFAULT},
        "quantities": ["grip_force", "compression", "peak_von_mises"],
    },
)
_PBD = _Template(
    equal={
        "solver_iterations": ("models.pbd.sweeps",),
        "substeps": ("models.pbd.substeps",),
        "constraints.distance.stiffness": ("models.pbd.classic.stretch",),
        "constraints.bending.stiffness": ("models.pbd.classic.bending",),
        "collision.margin": ("body.thickness",),
        "collision.friction": ("body.friction", "tools.ground.friction", "tools.ball.friction"),
        "collision.restitution": ("body.restitution",),
    },
    without={
        "constraints.volume.stiffness": "sheets have no volume; of a tet_mesh by XPBD say constraints: "
        "[{kind: volume, bulk: 50e3}], in Pa",
    },
    assumed={
        "gravity": [0, 0, -9.81],
        "step": 0.01,
        "duration": 1.0,
        "body": {
            "kind": "sheet",
            "size": [0.3, 0.3],
            "divisions": [40, 40],
            "position": [0, 0, 0.16],
            "density": 0.2,
            "stretch": 500,
            "damping": 1.0,
        },
        "tools": {"ground": {"kind": "plane"}, "ball": {"kind": "sphere", "radius": 0.06, "position": [0, 0, 0.07]}},
        "regions": {"default": PARTICLES_DEFAULT},
        "models": {PARTICLES_DEFAULT: {"method": CLASSIC_PBD}},
        "quantities": ["worst_stretch", "stretch_violation", "sag"],
    },
)
TEMPLATES = {"fem_config": _FEM, "pbd_config": _PBD}


@dataclass(frozen=True)
class Line:
    """What a line of a template becomes: keys of the scene, or none and why."""

    number: int
    key: str
    value: Any
    became: tuple[str, ...]
    why: str

    @property
    def said(self) -> str:
        return f"{self.key}: {json.dumps(self.value)}"

    @property
    def becomes(self) -> str:
        return ", ".join(self.became) if self.became else f"no equal: {self.why}"


def scene_of(path: Path, name: str) -> tuple[str, list[Line]]:
    """Text of the scene that a template becomes, called `name`, and what became of each line. Raises SceneRefused."""
    file = _File.read(path)
    data = file.marked.data
    roots = list(data) if isinstance(data, dict) else []
    if len(roots) != 1 or roots[0] not in TEMPLATES:
        unknown = next((key for key in roots if key not in TEMPLATES), "")
        raise file.refused((unknown,) if unknown else (), f"a template has one key: {' or '.join(TEMPLATES)}")
    template, root = TEMPLATES[roots[0]], (roots[0],)
    if not isinstance(data[roots[0]], dict):
        raise file.refused(root, f"{roots[0]} is a mapping of keys, e.g. {template.keys[0]}")
    scene: dict[str, Any] = {"softseam": 1, "name": name, **json.loads(json.dumps(template.assumed))}
    lines: list[Line] = []
    places: dict[str, marked_yaml.Path] = {}
    for key, at, value in file.entries(data[roots[0]], root):
        if key not in template.keys:
            raise file.unknown(at, key, template.keys)
        if key in places:
            raise file.refused(at, f"{key} is given twice: leave one out")
        places[key] = at
        became = template.equal.get(key, ())
        for target in became:
            _put(scene, target, value)
        lines.append(Line(file.marked.values[at].line, key, value, became, template.without.get(key, "")))
    text = _written(path.name, scene, lines)
    try:
        parse_scene(text)
    except SceneError as error:
        raise file.of_template(template, places, root, error) from None
    return text, lines


def import_template(path: Path, out: Path | None, console: Console) -> None:
    """Write the scene of a template, and say of each line what became of it. Raises SceneRefused and BadInput."""
    out = out or Path(f"{path.stem}_scene.yaml")
    if out.suffix not in (".yaml", ".yml"):
        raise BadInput(f"--out {out}: the name of a scene ends in .yaml")
    text, lines = scene_of(path, re.sub(r"[^A-Za-z0-9_-]", "_", out.stem))
    check_outputs([("--out", out)], inputs={"the template itself": path})
    if out.exists():
        raise BadInput(f"--out {out}: that file is there already: name another one, or remove it")
    try:
        write_whole(out, text)
    except OSError as error:
        raise cannot_write(out, error) from None
    table = Table(box=None, pad_edge=False, header_style="dim")
    for heading in ("line", "template", "scene"):
        table.add_column(heading)
    for line in lines:
        row = (f"{path.name}:{line.number}", line.said, line.becomes)
        table.add_row(*map(Text, row), style="" if line.became else "yellow")
    console.print(table)
    console.print(Text(f"assumed, as the template does not say it: {_assumed(lines)}"))
    console.print(Text(f"scene: {out} (softseam run {out})"), soft_wrap=True)


@dataclass(frozen=True)
class _File:
    """A template as it was read."""

    path: Path
    marked: marked_yaml.Marked

    @classmethod
    def read(cls, path: Path) -> Self:
        """Raises SceneRefused."""
        try:
            with path.open("rb") as file:
                raw = file.read(MAX_SCENE_BYTES + 1)
            if len(raw) > MAX_SCENE_BYTES:
                raise SceneRefused(f"{path}:1:1: larger than {MAX_SCENE_BYTES} bytes: is this a template?")
            return cls(path, marked_yaml.parse(raw.decode("utf-8-sig")))
        except OSError as error:
            raise SceneRefused(f"{path}:1:1: cannot be read: {error.strerror}") from None
        except UnicodeDecodeError:
            raise SceneRefused(f"{path}:1:1: not UTF-8 text: is this a template?") from None
        except marked_yaml.YamlError as error:
            raise SceneRefused(f"{path}:{error.mark.line}:{error.mark.column}: {error}") from None

    def entries(self, value: Any, at: marked_yaml.Path, key: str = "") -> Iterator[tuple[str, marked_yaml.Path, Any]]:
        """Each value with its key, in which an entry of a list has its `type`, and its place in the file."""
        if isinstance(value, dict):
            for name, inner in value.items():
                yield from self.entries(inner, (*at, name), f"{key}.{name}" if key else str(name))
        elif isinstance(value, list):
            for i, entry in enumerate(value):
                kind = entry.get("type") if isinstance(entry, dict) else None
                if not isinstance(kind, str):
                    raise self.refused((*at, i), f"{key}: an entry says its type, e.g. type: distance")
                rest = {name: inner for name, inner in entry.items() if name != "type"}
                yield from self.entries(rest, (*at, i), f"{key}.{kind}")
        else:
            yield key, at, value

    def of_template(
        self,
        template: _Template,
        places: Mapping[str, marked_yaml.Path],
        root: marked_yaml.Path,
        error: SceneError,
    ) -> SceneRefused:
        """What is wrong with the scene as what is wrong with the template's key that it comes from."""
        source = next((key for key, targets in template.equal.items() if error.key in targets), "")
        hint = f"; did you mean {error.nearest!r}?" if error.nearest else ""
        problem = error.problem + hint + (f" (allowed: {error.allowed})" if error.allowed else "")
        if not source:
            return self.refused(root, f"the scene that it becomes is none: {error.key}: {problem}")
        if source not in places:
            return self.refused(root, f"{source} is missing")
        return self.refused(places[source], f"{source}: {problem}")

    def unknown(self, at: marked_yaml.Path, key: str, keys: list[str]) -> SceneRefused:
        near = difflib.get_close_matches(key, keys, 1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        return self.refused(at, f"{key}: unknown key{hint} (allowed: {', '.join(keys)})")

    def refused(self, at: marked_yaml.Path, problem: str) -> SceneRefused:
        mark = self.marked.keys.get(at, self.marked.values[at])
        return SceneRefused(f"{self.path}:{mark.line}:{mark.column}: {problem}")


def _put(scene: dict[str, Any], key: str, value: Any) -> None:
    *parents, last = key.split(".")
    for parent in parents:
        scene = scene.setdefault(parent, {})
    scene[last] = value


def _written(name: str, scene: dict[str, Any], lines: list[Line]) -> str:
    """The scene's text, under what became of each line."""
    head = [f"# Made by `softseam import {name}`. Assumed, as the template does not say it: {_assumed(lines)}."]
    head += [f"# {line.number}: {line.said} -> {line.becomes}" for line in lines]
    dumped = yaml.safe_dump(scene, sort_keys=False, default_flow_style=None, width=110)
    return "\n".join([*head, dumped])


def _assumed(lines: list[Line]) -> str:
    said = {target for line in lines for target in line.became}
    more = [word for word, key in (("density", "body.material.density"), ("step", "step")) if key not in said]
    return ", ".join(["body", "tools", "motion", *more])
