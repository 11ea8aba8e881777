"""The textbook's pitfalls, each with a control that is seen to fail and the remedy that holds, both measured."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from softseam.errors import BadInput
from softseam_studies.atlas.controls import (
    closed_cycle,
    constraint_order,
    counted_iterations,
    courant,
    energy_drift,
    hourglass,
    large_rotation,
    locking,
    mass,
    negative_jacobian,
)
from softseam_studies.study.store import Store

PREFIX = "pitfall"
"""of the files' names"""


@dataclass(frozen=True)
class Row:
    """One pitfall."""

    name: str
    control: str
    """what was done wrong, and the figure of it"""
    remedy: str
    """what is done here, and its figure"""
    holds: bool
    """whether the control failed and the remedy held"""
    test: str
    """the test that keeps it so"""


def rows_json(rows: Sequence[Row]) -> list[dict[str, Any]]:
    return [asdict(row) for row in rows]


PITFALLS: dict[str, Callable[[], tuple[str, str, bool, str]]] = {
    "Locking": locking,
    "Hourglassing": hourglass,
    "Negative Jacobian": negative_jacobian,
    "Order of constraints": constraint_order,
    "Stiffness follows iterations": counted_iterations,
    "Mass of the deformed volume": mass,
    "Stress that is no derivative": closed_cycle,
    "Linear strain in a large turn": large_rotation,
    "Courant's limit": courant,
    "Energy drift": energy_drift,
}


def pitfalls(store: Store) -> list[Row]:
    """Measure every pitfall, or read what was measured before."""
    rows = []
    for name, measure in PITFALLS.items():
        key = _key(name)
        data = store.read(key)
        if data is None:
            control, remedy, holds, test = measure()
            data = asdict(Row(name, control, remedy, holds, test))
            store.write(key, data)
        rows.append(Row(**data))
    return rows


def kept_pitfalls(store: Store) -> list[Row]:
    """What was measured before; none where a pitfall is missing, spoilt or of other code."""
    try:
        found = [store.read(_key(name)) for name in PITFALLS]
    except BadInput:
        return []
    return [Row(**data) for data in found if data is not None] if None not in found else []


def _key(name: str) -> str:
    return f"{PREFIX}-" + name.lower().replace(" ", "-").replace("'", "")
