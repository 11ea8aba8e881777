"""Foods that a scene may name in place of a material's numbers: each number with where it comes from.

`material: tofu_firm` takes all of them, `material: {food: tofu_firm, young: 30e3}` all but those that follow. What is
simulated, recorded and hashed are the numbers.

*Moduli.* `young` and `poisson` are what a quick load feels. A slow test feels what branches leave, so where a food has
branches its quick modulus is such that the slow one is as measured. Where tension, compression and shear were measured,
compression decides, as that is what fingers do: of a cylinder of 8 mm x 10 mm between plates that it is glued to, which
makes it 1.19 times as stiff as a free one (tests/verification/test_foods.py). The range is that of all three.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from softseam_protocol.scene.spec import not_among, wrong
from softseam_protocol.table import Table

__all__ = ["ASSUMED", "FOODS", "Food", "Number", "with_food"]

ASSUMED = "assumed"
"""source of a number for which none was found"""

ST_PIERRE = (
    "St. Pierre et al., npj Science of Food (2024), doi 10.1038/s41538-024-00330-6, its data: LivingMatterLab/CANN"
)
LIONS_MANE = "lion's mane mushroom steak, doi 10.64898/2026.01.19.700477, its data: LivingMatterLab/CANN"
FUNGI_STEAK = "fungi steak, doi 10.1016/j.actbio.2025.07.002, its data: LivingMatterLab/CANN"
DELI = (
    "mean of 3 mu fitted to biaxial pulls by 8 % of each of 8 samples, in the form of the authors' script, "
    "Curr. Res. Food Sci., doi 10.1016/j.crfs.2025.101080, its data: LivingMatterLab/CANN"
)
PROSCIUTTO = DELI.replace("8 %", "18 %")
CHARALAMBIDES = "Charalambides et al., J. Mater. Sci. 36:2313 (2001)"
AI4CHEESE = "shear moduli of 208 to 390 kPa at .2 to 16 rad/s, AI4Cheese"
SAPIRSTEIN = "Sapirstein et al., J. Cereal Sci. 32:235 (2000)"
ROSS = "Ross and Scanlon (1999)"
GRILLED = "J. Food Quality 2022, 9176628, table 4"
CRUSHED_CHEESE = "omicsonline 2155-9600-2-136, table 4: at 33 % compression"
NOODLES = "JAKO198303041889139, koreascience.or.kr"


Relaxation = tuple[tuple[tuple[float, float], ...], str]


@dataclass(frozen=True)
class Number:
    """One of a food's numbers, in SI units.

    value   that is taken
    source  where it is from; ASSUMED where none was found
    range   between which measurements of it lie, least and largest; None: not known
    """

    value: float
    source: str = ASSUMED
    range: tuple[float, float] | None = None

    @property
    def assumed(self) -> bool:
        """Whether no source was found."""
        return self.source.startswith(ASSUMED)


@dataclass(frozen=True)
class Food:
    """What a food is made of.

    what        in words
    numbers     of its material, by their names there
    relaxation  share and time [s] of each branch, and their source
    besides     what else is known of it, which no law takes: friction [1], fracture_energy [J/m^2]
    """

    what: str
    numbers: Mapping[str, Number]
    relaxation: Relaxation = ((), ASSUMED)
    besides: Mapping[str, Number] = field(default_factory=dict)

    @property
    def material(self) -> dict[str, Any]:
        """As a scene says it."""
        said: dict[str, Any] = {name: number.value for name, number in self.numbers.items()}
        branches, _ = self.relaxation
        if branches:
            said["relaxation"] = [{"share": share, "time": time} for share, time in branches]
        return said


def _of(
    young: Number, poisson: Number | None = None, density: Number | None = None, strength: Number | None = None
) -> dict[str, Number]:
    """The numbers of a material, water's density and hardly a change of volume where these are not known, and no
    strength."""
    known = {"young": young, "poisson": poisson or Number(0.47), "density": density or Number(1050.0)}
    return known if strength is None else known | {"strength": strength}


_TOFU: Relaxation = ((0.12, 0.05), (0.12, 0.5), (0.12, 5.0)), ASSUMED
_POWER_LAW: Relaxation = (
    ((0.21, 0.01), (0.16, 0.1), (0.13, 1.0), (0.10, 10.0)),
    f"{ASSUMED}: a shear modulus as the frequency^.1",
)

FOODS: Table[Food] = Table(
    "foods",
    {
        "tofu_firm": Food(
            "organic firm tofu",
            _of(Number(35.5e3, ST_PIERRE, (33.8e3, 44.8e3)), strength=Number(4.0e3, ASSUMED, (3.5e3, 4.5e3))),
            _TOFU,
            {
                "friction": Number(0.3),
                "fracture_energy": Number(3.0),
            },
        ),
        "tofu_extra_firm": Food(
            "organic extra firm tofu",
            _of(Number(29.1e3, ST_PIERRE, (29.1e3, 56.1e3)), strength=Number(4.0e3, ASSUMED, (3.2e3, 4.8e3))),
            _TOFU,
            {
                "friction": Number(0.3),
                "fracture_energy": Number(3.0),
            },
        ),
        "hot_dog": Food(
            "a wiener of pork and chicken, stiffer when pulled",
            _of(Number(78.0e3, ST_PIERRE, (78.0e3, 179.0e3))),
            _POWER_LAW,
        ),
        "plant_hot_dog": Food("a wiener made of plants", _of(Number(78.5e3, ST_PIERRE, (78.5e3, 112.0e3))), _POWER_LAW),
        "turkey_sausage": Food(
            "polska kielbasa, three times as stiff when pulled",
            _of(Number(86.0e3, ST_PIERRE, (74.0e3, 316.0e3))),
            _POWER_LAW,
        ),
        "plant_sausage": Food("a frankfurter made of plants", _of(Number(82.3e3, ST_PIERRE, (82.3e3, 101.5e3)))),
        "spam_turkey": Food("canned turkey meat, minced", _of(Number(55.9e3, ST_PIERRE, (55.9e3, 111.5e3)))),
        "tofurky": Food("a roast made of wheat and tofu", _of(Number(172.6e3, ST_PIERRE, (172.6e3, 224.5e3)))),
        "mozzarella": Food(
            "low-moisture mozzarella: it flows, so nothing is left of a load that stays",
            _of(
                Number(1.86e6, AI4CHEESE),
                Number(0.49),
                Number(1080.0),
                Number(59.0e3, CRUSHED_CHEESE, (53.0e3, 65.0e3)),
            ),
            (
                ((0.45, 0.03), (0.075, 0.3), (0.155, 1.0), (0.013, 3.0), (0.072, 10.0), (0.235, 30.0)),
                f"fitted to {AI4CHEESE}",
            ),
            {"friction": Number(0.3, CHARALAMBIDES, (0.1, 0.3)), "fracture_energy": Number(20.0)},
        ),
        "mushroom_lions_mane": Food(
            "steak of the mushroom Hericium erinaceus",
            _of(Number(104.8e3, LIONS_MANE, (58.0e3, 150.0e3))),
            (
                ((0.271, 0.01), (0.146, 0.1), (0.109, 1.0), (0.143, 10.0)),
                f"fitted to sweeps of 20 samples from .1 to 63 rad/s within 4 %, {LIONS_MANE}",
            ),
        ),
        "mycelium_steak": Food(
            "steak of fungi's roots",
            _of(Number(199.0e3, FUNGI_STEAK, (87.0e3, 311.0e3))),
            (
                ((0.324, 0.01), (0.175, 0.1), (0.137, 1.0), (0.169, 10.0)),
                f"fitted to sweeps of 20 samples from .1 to 63 rad/s within 9 %, {FUNGI_STEAK}",
            ),
        ),
        "chicken_grilled": Food(
            "poultry, grilled, softest across",
            _of(Number(43.8e3, GRILLED, (30.6e3, 74.4e3)), Number(0.37, GRILLED, (0.23, 0.49))),
        ),
        "pork_grilled": Food(
            "pork, grilled, stiffer the hotter",
            _of(Number(62.2e3, GRILLED, (28.5e3, 146.8e3)), Number(0.39, GRILLED, (0.25, 0.49))),
        ),
        "deli_chicken": Food("roast chicken, sliced, pulled", _of(Number(117.3e3, DELI, (86.8e3, 141.4e3)))),
        "deli_ham": Food("cooked ham, sliced, pulled", _of(Number(116.6e3, DELI, (87.7e3, 152.4e3)))),
        "deli_turkey": Food("roast turkey, sliced, pulled", _of(Number(134.0e3, DELI, (58.8e3, 208.7e3)))),
        "prosciutto": Food("cured ham, sliced, pulled", _of(Number(48.7e3, PROSCIUTTO, (10.6e3, 68.4e3)))),
        "plant_ham": Food("ham made of plants, sliced, pulled", _of(Number(343.1e3, DELI, (262.6e3, 412.4e3)))),
        "plant_slices_hickory": Food(
            "hickory-smoked slices made of plants, pulled", _of(Number(213.2e3, DELI, (182.5e3, 255.0e3)))
        ),
        "plant_turkey": Food("turkey made of plants, sliced, pulled", _of(Number(378.4e3, DELI, (356.1e3, 394.4e3)))),
        "plant_prosciutto": Food(
            "prosciutto made of plants, sliced, pulled", _of(Number(112.5e3, PROSCIUTTO, (46.3e3, 214.6e3)))
        ),
        "agar_gel": Food("agar gel", _of(Number(52.0e3, ROSS), Number(0.32, ROSS), Number(1010.0))),
        "bread_crumb": Food(
            "crumb of white bread, which does not bulge",
            _of(Number(11.0e3, SAPIRSTEIN, (8.0e3, 50.0e3)), Number(0.0), Number(250.0), Number(1.0e3, SAPIRSTEIN)),
            besides={
                "friction": Number(0.4),
                "fracture_energy": Number(4.1, SAPIRSTEIN),
            },
        ),
        "noodle_wheat": Food(
            "a cooked noodle of wheat", _of(Number(70.0e3, NOODLES)), besides={"friction": Number(0.3)}
        ),
        "noodle_starch": Food(
            "a cooked noodle of starch", _of(Number(39.0e3, NOODLES)), besides={"friction": Number(0.3)}
        ),
    },
)
"""by the name in a scene; each has a modulus with a source"""


def with_food(said: Any) -> Any:
    """A material as its numbers, where a scene names a food; anything else as it is. Raises pydantic's errors."""
    if isinstance(said, str):
        return _food(said).material
    if isinstance(said, Mapping) and "food" in said:
        name = said["food"]
        if not isinstance(name, str):
            raise wrong("a food is named", "food")
        return _food(name, "food").material | {key: value for key, value in said.items() if key != "food"}
    return said


def _food(name: str, *at: str) -> Food:
    if name not in FOODS:
        raise not_among(f"{json.dumps(name)} is not in the table of {FOODS.title}", list(FOODS), *at)
    return FOODS[name]
