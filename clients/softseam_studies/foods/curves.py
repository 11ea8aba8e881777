"""What a food does when it is pulled, pressed and held: curves of a bar whose sides are free, by its own numbers.

Lasting is a neo-Hookean spring of mu_inf and the bulk modulus K; each branch has an isochoric spring mu_i behind it.
Along the bar, with the stretch l, a across, J = l a^2, x = l J^(-1/3):

    P l = mu_inf (l^2 - 1) + lambda ln J + 2/3 q,   0 = mu_inf (a^2 - 1) + lambda ln J - q/3,                      (1)
    q = sum_i mu_i (x^2 - 1/x),   lambda = K - 2/3 mu_inf                                                          (2)

at once; when branches have faded, q = 0 (docs/reference/laws.md).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from softseam.view.paper import INK, PAPER, SOFT, heading, plain, write
from softseam_protocol.scene.foods import Food

Floats = NDArray[np.float64]

QUICK, SLOW = "#c2410c", "#1d4ed8"


def bar_stress(food: Food, stretch: Floats, faded: bool) -> Floats:
    """Force over first area (n,) [Pa] of a bar at these stretches (n,), at once or when branches have faded; (1)."""
    young, poisson = (food.numbers[key].value for key in ("young", "poisson"))
    branches, _ = food.relaxation
    shear, bulk = young / (2.0 + 2.0 * poisson), young / (3.0 - 6.0 * poisson)
    lasting = shear * (1.0 - sum(share for share, _ in branches))
    fading = 0.0 if faded else shear - lasting
    second = bulk - 2.0 / 3.0 * lasting

    def both(across: Floats) -> tuple[Floats, Floats]:
        volume = stretch * across**2
        x = stretch * volume ** (-1.0 / 3.0)
        q = fading * (x**2 - 1.0 / x)
        along = lasting * (stretch**2 - 1.0) + second * np.log(volume) + 2.0 / 3.0 * q
        return along, lasting * (across**2 - 1.0) + second * np.log(volume) - q / 3.0

    low, high = np.full_like(stretch, 0.2), np.full_like(stretch, 5.0)
    for _ in range(60):  # the side's stress grows with its stretch
        middle = 0.5 * (low + high)
        above = both(middle)[1] > 0.0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return both(0.5 * (low + high))[0] / stretch


def draw_food(name: str, food: Food, path: Path) -> Path:
    """Pulled and pressed by up to 30 %, and held for a minute."""
    stretch, time = np.linspace(0.7, 1.3, 121), np.logspace(-3.0, np.log10(60.0), 200)
    branches, _ = food.relaxation
    figure = Figure(figsize=(11.0, 4.6), dpi=150, facecolor=PAPER)
    heading(figure, name.replace("_", " "), food.what)
    left, right = figure.subplots(1, 2)
    figure.subplots_adjust(left=0.075, right=0.975, top=0.72, bottom=0.14, wspace=0.2)
    plain(left, "force over first area of a free bar [kPa]", "stretch")
    young = food.numbers["young"]
    curves = [("at once", QUICK, False)] + ([("after long", SLOW, True)] if branches else [])
    for text, tone, faded in curves:
        stress = 1e-3 * bar_stress(food, stretch, faded)
        if young.range is not None:
            low, high = (each / young.value for each in young.range)
            left.fill_between(stretch, low * stress, high * stress, color=tone, alpha=0.12, linewidth=0.0)
        left.plot(stretch, stress, color=tone, linewidth=1.8, label=text)
    strength = food.numbers.get("strength")
    if strength is not None:
        left.axhline(1e-3 * strength.value, color=SOFT, linestyle=(0, (4, 3)), linewidth=1.1)
        left.text(0.86, 1e-3 * strength.value, "breaks", fontsize=9, color=SOFT, va="bottom")
    left.legend(frameon=False, fontsize=9, labelcolor=INK)
    plain(right, "shear stress of a shape that is held, over that at once [%]", "time [s]")
    left_over = 1.0 - sum((share * (1.0 - np.exp(-time / tau)) for share, tau in branches), np.zeros_like(time))
    right.semilogx(time, 100.0 * left_over, color=INK, linewidth=1.8)
    right.set_ylim(0.0, 104.0)
    return write(figure, path)
