"""What can be found: numbers of a scene, where they begin, and the settings that they become."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from softseam.errors import BadInput, not_among
from softseam_protocol.scene.scene import Scene

_YOUNG, _FRICTION = "young", "friction"
_LEAST_FRICTION, _MOST_FRICTION = 0.01, 3.0
_SPAN = 100.0
"""times that Young's modulus may differ from the scene's"""


@dataclass(frozen=True)
class Number:
    """One that is to be found."""

    name: str
    unit: str
    start: float
    low: float
    high: float
    keys: tuple[str, ...]
    """of the scene that have it"""
    direction: tuple[float, Mapping[str, float]]
    """what a unit of it is: of Young's modulus [Pa], and of the friction of tools [1]"""

    def settings(self, value: float) -> list[str]:
        """The scene's keys with this value, as --set takes them."""
        return [f"{key}={value!r}" for key in self.keys]


def numbers_of(scene: Scene, asked: str) -> list[Number]:
    """Those that a list of names, with commas between, asks for. Raises BadInput."""
    names = [name.strip() for name in asked.split(",")]
    known = [_YOUNG, _FRICTION, *(f"{_FRICTION}.{tool}" for tool in scene.tools)]
    for name in names:
        if name not in known:
            raise BadInput(f"--find {asked}: nothing is called {not_among(name, known)}")
    if len(set(names)) < len(names) or (_FRICTION in names and any(name.startswith("friction.") for name in names)):
        raise BadInput(f"--find {asked}: name each number once, and friction either of all tools or of some")
    return [_young(scene) if name == _YOUNG else _friction(scene, name, asked) for name in names]


def _young(scene: Scene) -> Number:
    spec = scene.body
    body = spec.in_cells
    if body is None:
        raise BadInput(f"--find young: a {spec.kind} has no Young's modulus: fit a body of cells")
    if body.inclusions:
        raise BadInput("--find young: the body has `inclusions` of other materials, and so no one Young's modulus")
    young = body.material.young
    return Number(_YOUNG, "Pa", young, young / _SPAN, young * _SPAN, ("body.material.young",), (1.0, {}))


def _friction(scene: Scene, name: str, asked: str) -> Number:
    tool = name.partition(".")[2]
    tools: Sequence[str] = [tool] if tool else list(scene.tools)
    values = {scene.tools[each].friction for each in tools}
    if not tools:
        raise BadInput(f"--find {asked}: the scene has no tools, so no friction")
    if len(values) > 1:
        have = ", ".join(f"{value:g}" for value in sorted(values))
        raise BadInput(
            f"--find {asked}: tools have different `friction` ({have}), and this is one number for all: name one, e.g. "
            f"friction.{tools[-1]}"
        )
    start = values.pop()
    if not _LEAST_FRICTION <= start <= _MOST_FRICTION:
        raise BadInput(
            f"--find {asked}: `tools.{tools[0]}.friction` is {start:g}: begin between {_LEAST_FRICTION:g} and "
            f"{_MOST_FRICTION:g}, e.g. --set tools.{tools[0]}.friction=0.3"
        )
    keys = tuple(f"tools.{each}.friction" for each in tools)
    return Number(name, "", start, _LEAST_FRICTION, _MOST_FRICTION, keys, (0.0, dict.fromkeys(tools, 1.0)))
