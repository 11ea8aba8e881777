"""`softseam materials`: the foods that a scene may name, and where each number of one is from."""

from __future__ import annotations

import textwrap
from math import exp
from pathlib import Path

from rich.console import Console
from rich.table import Table

from softseam.errors import BadInput
from softseam.outputs import check_ending, check_outputs
from softseam_protocol.scene.foods import FOODS, Food, Number
from softseam_studies.cli_fitting import Foods
from softseam_studies.foods.curves import draw_food

UNITS = {
    "young": ("kPa", 1e-3),
    "poisson": ("", 1.0),
    "density": ("kg/m³", 1.0),
    "friction": ("", 1.0),
    "strength": ("kPa", 1e-3),
    "fracture_energy": ("J/m²", 1.0),
}
"""of each number, as it is shown, and how often its SI unit goes into that"""


def foods(wishes: Foods, console: Console) -> None:
    """List all, or show one. Raises BadInput."""
    if wishes.show is not None:
        show_food(wishes.show, wishes.picture, console)
    elif wishes.picture is not None:
        raise BadInput("--picture: say with --show of which food")
    else:
        list_foods(console)


def list_foods(console: Console) -> None:
    """A line each."""
    table = Table(box=None, pad_edge=False, header_style="dim")
    for heading in ("material", "young", "measured", "left after a minute", "assumed", ""):
        table.add_column(heading)
    for name, food in FOODS.items():
        young = food.numbers["young"]
        table.add_row(
            name,
            shown("young", young),
            _range("young", young),
            f"{100.0 * lasting(food, 60.0):.0f} %",
            _assumed(food),
            food.what,
        )
    console.print(table)
    console.print(
        "\n`material: tofu_firm`, or `material: {food: tofu_firm, young: 30e3}` for other numbers. young is what a "
        "quick load feels. softseam materials --show tofu_firm names the source of each number, and draws its curves."
    )


def show_food(name: str, picture: Path | None, console: Console) -> None:
    """All of one: its numbers, their sources, and its curves where a picture is asked for."""
    food = FOODS[name]
    if picture is not None:
        check_ending("--picture", picture, ".png", "a picture")
        check_outputs([("--picture", picture)], inputs={})
    console.print(f"{name}: {food.what}\n")
    table = Table(box=None, pad_edge=False, header_style="dim")
    for heading in ("", "value", "measured", "from"):
        table.add_column(heading)
    for key, number in {**food.numbers, **food.besides}.items():
        table.add_row(key, shown(key, number), _range(key, number), number.source)
    branches, source = food.relaxation
    for place, (share, time) in enumerate(branches):
        table.add_row(
            "relaxation" if place == 0 else "", f"{100.0 * share:.3g} % in {time:g} s", "", source if place == 0 else ""
        )
    console.print(table)
    if food.besides:
        text = f"No law takes {', '.join(food.besides)} yet: friction is of tools and contacts, and nothing breaks."
        console.print("\n" + textwrap.fill(text, 100))
    if picture is not None:
        console.print(f"\n{draw_food(name, food, picture)}")


def shown(key: str, number: Number) -> str:
    """A number with its unit."""
    unit, factor = UNITS[key]
    return f"{number.value * factor:.4g} {unit}".strip()


def lasting(food: Food, after: float) -> float:
    """Share of the quick shear modulus that is left so long after a shape was given [s]."""
    branches, _ = food.relaxation
    return 1.0 - sum(share * (1.0 - exp(-after / time)) for share, time in branches)


def _range(key: str, number: Number) -> str:
    if number.range is None:
        return ""
    _, factor = UNITS[key]
    low, high = number.range
    return f"{low * factor:.4g} to {high * factor:.4g}"


def _assumed(food: Food) -> str:
    names = [key for key, number in food.numbers.items() if number.assumed]
    branches, source = food.relaxation
    if branches and source.startswith("assumed"):
        names.append("relaxation")
    return ", ".join(names)
