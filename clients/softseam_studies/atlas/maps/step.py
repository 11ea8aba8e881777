"""Step against Young's modulus, with FEM, XPBD and both: a squeeze by a tenth, whose force over E A is one number."""

from functools import partial

from softseam_studies.atlas.maps.grid import Cell, Map, Panel
from softseam_studies.atlas.scenes import MODELS, Model, force_share, press, pressed
from softseam_studies.atlas.trace import follow
from softseam_studies.atlas.verdicts import Verdict, judge

HYBRID = (1e3, 1e4, 1e5, 1e6)
HYBRID_STEPS = (0.001, 0.005, 0.01, 0.02, 0.05)
"""fewer where both models meet: there a run can cost ten seconds"""
BOUND = 0.02
SQUEEZE = 0.1


def build(
    steps: tuple[float, ...] = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1),
    youngs: tuple[float, ...] = (1e3, 3e3, 1e4, 3e4, 1e5, 3e5, 1e6),
) -> Map:
    """The map; a smaller one for tests."""
    cells = [
        Cell(
            panel,
            i,
            j,
            f"{MODELS[model]}, step {1e3 * step:g} ms, E {_kpa(young)}",
            partial(run, young, step, model),
            (0.05 + 0.0002 / step) * (8.0 if model == "hybrid" else 1.0),
        )
        for panel, model in enumerate(MODELS)
        for i, step in enumerate(_columns(model, steps))
        for j, young in enumerate(_rows(model, youngs))
    ]

    def panel(model: Model) -> Panel:
        columns = tuple(f"{1e3 * step:g}" for step in _columns(model, steps))
        return Panel(MODELS[model], "step [ms]", "Young's modulus", columns, tuple(map(_kpa, _rows(model, youngs))))

    return Map(
        "step",
        "Step against stiffness",
        "A 20 mm cube (nu 0.3) is squeezed by a tenth between smooth plates in 0.1 s and held. Accurate: the held "
        f"force is within {100 * BOUND:g} % of its closed form, {pressed(SQUEEZE):.4f} E A (Young's modulus, area at "
        "rest).",
        tuple(panel(model) for model in MODELS),
        tuple(cells),
    )


def run(young: float, step: float, model: Model) -> Verdict:
    """One cell."""
    return judge(follow(press(young, step, model), force_share(young)), pressed(SQUEEZE), BOUND, "force")


def _rows(model: Model, youngs: tuple[float, ...]) -> tuple[float, ...]:
    return youngs if model != "hybrid" else tuple(young for young in youngs if young in HYBRID)


def _columns(model: Model, steps: tuple[float, ...]) -> tuple[float, ...]:
    return steps if model != "hybrid" else tuple(step for step in steps if step in HYBRID_STEPS)


def _kpa(young: float) -> str:
    return f"{young / 1e6:g} MPa" if young >= 1e6 else f"{young / 1e3:g} kPa"
