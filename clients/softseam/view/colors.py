"""Colours: one palette for replays and pictures, and a perceptual scale for stress."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softseam.columns import MANY
from softseam_protocol.messages.names import local, within
from softseam_protocol.models import FAR_DEFAULT, MODELS, NEAR_DEFAULT, facts_of

Floats = NDArray[np.float64]
Tone = tuple[int, int, int]

NEAR: Tone = MODELS[NEAR_DEFAULT].colour
"""warm coral: the near region (usually FEM)"""
FAR: Tone = MODELS[FAR_DEFAULT].colour
"""slate blue: the far region (usually PBD)"""
BORDER = (255, 255, 255)
"""white: where an inclusion begins"""
TOOL = (166, 172, 184)
GROUND = (52, 56, 66)
CONTACT = (255, 209, 92)
MULTIPLIER = (93, 211, 158)
BETWEEN = (224, 64, 184)
"""magenta: what bodies do to one another"""
SERIES = (NEAR, FAR, MULTIPLIER, CONTACT, (190, 132, 214), (226, 96, 128), (150, 158, 170))

# Viridis-like knots lifted at the dark end, so that an unstressed body still shows its shading: sRGB, equal steps.
_KNOTS = np.array(
    [
        (74, 78, 150),
        (64, 101, 160),
        (51, 123, 161),
        (40, 143, 155),
        (45, 163, 141),
        (79, 182, 118),
        (130, 199, 86),
        (190, 214, 58),
        (253, 231, 37),
    ],
    dtype=np.float64,
)


def stress_colors(values: Floats, top: float) -> NDArray[np.uint8]:
    """RGB of each value on the scale from 0 to `top` (n, 3)."""
    at = np.clip(values / top if top > 0.0 else np.zeros_like(values), 0.0, 1.0) * (len(_KNOTS) - 1)
    low = np.minimum(at.astype(np.int64), len(_KNOTS) - 2)
    part = (at - low)[..., None]
    return np.asarray(np.rint(_KNOTS[low] * (1.0 - part) + _KNOTS[low + 1] * part), dtype=np.uint8)


def round_up(value: float) -> float:
    """The next of 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10 times a power of ten: the end of a scale that people can read."""
    if not value > 0.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(s * power for s in (1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10) if s * power >= value * (1 - 1e-9)))


def engineering(value: float, unit: str) -> str:
    """A value with the prefix that suits it: 4500 Pa -> '4.5 kPa'."""
    for factor, prefix in ((1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")):
        if abs(value) >= factor:
            return f"{value / factor:.3g} {prefix}{unit}"
    return f"{value:.3g} {unit}"


def parts(models: Mapping[str, str]) -> dict[str, tuple[str, Tone]]:
    """Label and colour of each part, near before far: those of its model, or of its region where both have one model.

    >>> parts({"body.far": NEAR_DEFAULT}) == {"body.far": ("FEM", NEAR)}
    True

    models  by part, BODY.near or BODY.far, as in `Columns.models`
    """
    bodies = [name.rpartition(".")[0] for name in models]
    found = {}
    for name in sorted(models, key=lambda name: (name.rpartition(".")[0], local(name) == "far")):
        body, model = name.rpartition(".")[0], facts_of(models[name])
        of = f"{body}, " if len({*bodies}) > 1 else ""
        where = f"{local(name)} part: " if bodies.count(body) > 1 else ""
        one = where and models[within(body, "near")] == models[within(body, "far")]
        tone = {"near": NEAR, "far": FAR}[local(name)] if one else model.colour
        found[name] = (f"{of}{where}{model.legend}", tone)
    return found


def grouped(models: Mapping[str, str]) -> dict[str, tuple[Tone, list[str]]]:
    """Labels of parts with their colour and the parts of each: where there are many, those of a model together."""
    each = parts(models)
    if len(each) <= MANY:
        return {label: (tone, [name]) for name, (label, tone) in each.items()}
    found: dict[str, tuple[Tone, list[str]]] = {}
    for name, (_, tone) in each.items():
        found.setdefault(facts_of(models[name]).legend, (tone, []))[1].append(name)
    return {f"{model}: {len(names)} parts": (tone, names) for model, (tone, names) in found.items()}


def named(tone: Tone) -> str:
    """A colour in a word, or as #rrggbb."""
    return {NEAR: "coral", FAR: "blue"}.get(tone) or "#" + bytes(tone).hex()


def whole_bodies(models: Mapping[str, str]) -> str:
    """Which colour is which model where bodies are of one each; '' where one is cut."""
    bodies = [name.rpartition(".")[0] for name in models]
    if len({*bodies}) < len(bodies):
        return ""
    found = {facts_of(models[name]).legend: tone for name, (_, tone) in parts(models).items()}
    return ", ".join(f"{named(tone)} {legend}" for legend, tone in found.items())


def paler(tone: Tone) -> Tone:
    """Of what sleeps: half way to the colour of tools."""
    r, g, b = ((a + c) // 2 for a, c in zip(tone, TOOL, strict=True))
    return r, g, b


def tones(body: str, models: Mapping[str, str]) -> tuple[Tone, Tone]:
    """Colours of what is near and far of a body; models: see `parts`."""
    tone_of = {name: tone for name, (_, tone) in parts(models).items()}
    return tone_of.get(within(body, "near"), NEAR), tone_of.get(within(body, "far"), FAR)


def label(name: str) -> str:
    """A quantity's name as people write it: 'peak_von_mises' -> 'peak von Mises'."""
    return name.replace("_", " ").replace(".", ": ").replace("mises", "Mises")
