"""Messages that fare badly against how often they do, with FEM, XPBD and both."""

from functools import cache, partial

from softseam_protocol.scene.scene import Scene
from softseam_studies.atlas.faults import Told, disturbed, judged
from softseam_studies.atlas.maps.grid import Cell, Map, Panel
from softseam_studies.atlas.scenes import MODELS, YOUNG, Model, press
from softseam_studies.atlas.verdicts import Verdict

EVERY = (64, 32, 16, 8, 4)
FAULTS = ("killed in recovery", "killed", "an old one comes late", "reply lost", "request lost", "repeated")
STEP = 0.005


def build(every: tuple[int, ...] = EVERY) -> Map:
    """The map; a smaller one for tests."""
    cells = [
        Cell(
            panel,
            i,
            j,
            f"{MODELS[model]}, {fault}, one of {n}",
            partial(run, model, fault, n),
            0.5 if model == "hybrid" else 0.2,
        )
        for panel, model in enumerate(MODELS)
        for i, n in enumerate(every)
        for j, fault in enumerate(FAULTS)
    ]
    columns = tuple(f"1 of {n}" for n in every)
    return Map(
        "messages",
        "Messages lost, repeated, late",
        "The cube (E 20 kPa) is squeezed in steps of 5 ms; of the messages that ask a participant for a step, some are "
        "repeated, lost, overtaken, or find it dead (each at most once). Accurate: every force, momentum, position "
        "and stress is the same, bit for bit, as undisturbed, which 0 and R stand for here. A participant that is lost "
        "is brought back to its last checkpoint, and asked again for what followed.",
        tuple(Panel(MODELS[model], "messages harmed", "fault", columns, FAULTS) for model in MODELS),
        tuple(cells),
    )


def run(model: Model, fault: str, every: int) -> Verdict:
    """One cell."""
    return judged(disturbed(_scene(model), fault, every), undisturbed(model))


@cache
def undisturbed(model: Model) -> Told:
    """What the run reports when all messages arrive."""
    return disturbed(_scene(model), None, 1)


def _scene(model: Model) -> Scene:
    return Scene.model_validate(press(YOUNG, STEP, model, hold=0.3))
