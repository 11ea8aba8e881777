"""What a scene and its run are, in words: which model has which cells, symmetry, friction that varies."""

from collections.abc import Iterable, Mapping

from softseam.observation import Observation
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.messages.session import Event, PartReport
from softseam_protocol.scene.repeat import repeated
from softseam_protocol.scene.scene import Scene


def choice(scene: Scene, first: Observation) -> str:
    """Of every body, from the observation after the first step; of copies that are alike together."""
    texts = choices(scene, first.parts, first.events)
    together: dict[tuple[str, str], list[str]] = {}
    for name, text in texts.items():
        together.setdefault((repeated(name) or name, text), []).append(name)
    return "; ".join(
        text if len(texts) == 1 else f"{names[0]}: {text}" if len(names) == 1 else f"{len(names)} {group}: {text}"
        for (group, text), names in together.items()
    )


def choices(scene: Scene, parts: Mapping[str, PartReport], events: Iterable[Event]) -> dict[str, str]:
    """The same by body, from the parts and the events of the first step; a body's near part comes first."""
    reasons = [event.message for event in events if event.kind is EventKind.REGIONS]
    ordered = [part for _, part in sorted(parts.items(), reverse=True)]
    return {
        name: _of_body(scene, name, [part for part in ordered if part.body == name], reasons) for name in scene.bodies
    }


def _of_body(scene: Scene, name: str, parts: list[PartReport], reasons: list[str]) -> str:
    label = scene.models.label
    body = scene.bodies[name]
    if not body.has_cells:
        return f"{label(parts[0].model if parts else body.usual_model)}, which moves {body.made_of}"
    total = sum(part.n_cells for part in parts)
    if len(parts) == 1:
        has = f"{label(parts[0].model)} on all {total} cells"
    else:
        has = ", ".join(f"{label(part.model)} on {part.n_cells}" for part in parts)
        has += f" of {total} cells"
    if len(scene.bodies) > 1:
        reasons = [message.removeprefix(f"{name}: ") for message in reasons if message.startswith(f"{name}: ")]
    return f"{has}, for {reasons[0]}" if reasons else f"{has}, as the scene's regions say"


PARTS = ("all", "a half", "a quarter", "an eighth")
"""of a body, by the number of planes of symmetry"""


def symmetric(scene: Scene) -> str:
    """What FEM solves for; '' where the scene says no symmetry."""
    if not scene.symmetry:
        return ""
    part = PARTS[len(scene.symmetry)]
    axes = " and ".join(scene.symmetry)
    return f"in {axes}: where fem has all cells it solves for {part} of them; figures are the whole's"


def uneven_friction(scene: Scene) -> str:
    """How friction varies over the bodies on which it does; '' where there are none."""
    fields = {name: body.uneven_friction for name, body in scene.bodies.items()}
    found = {name: field.in_words for name, field in fields.items() if field is not None}
    return "; ".join(words if scene.one is not None else f"{name}: {words}" for name, words in found.items())
