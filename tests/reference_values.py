"""Values of independent codes, with the uncertainty of those who computed them, and how far a result is from them.

felupe 11.3 on graded hex20 or hex27, checked with CalculiX 2.20 or dolfinx 0.5; extrapolated over three meshes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

Found = dict[str, float]
References = Mapping[str, tuple[float, float]]
"""quantity: value, uncertainty"""

INDENTATION: References = {
    "force at 1 mm": (0.156720, 0.0031),
    "force at 2 mm": (0.450043, 0.0090),
    "force at 3 mm": (0.834575, 0.0167),
    "force at 4 mm": (1.295522, 0.0259),
    "von Mises at 2 mm": (623.18, 20.4),
    "von Mises at 4 mm": (1645.96, 36.2),
}
"""Block 50 x 50 x 40 mm, E 20 kPa, nu 0.45, on a bonded base; smooth sphere, radius 20 mm: force [N], and von Mises
stress [Pa] in the middle of the block."""

PAD: References = {
    "force at 5 %": (1.60370, 0.016),
    "force at 10 %": (3.25141, 0.033),
    "force at 15 %": (4.94714, 0.049),
    "von Mises, centre": (4020.6, 60.3),
    "von Mises, quarter of the axis": (3462.9, 51.9),
    "von Mises, under the pad": (522.95, 7.8),
    "von Mises, middle of a side": (1955.8, 29.3),
    "von Mises, half way aside": (2521.9, 37.8),
    "von Mises, half way up": (3010.5, 45.2),
}
"""Cube of 50 mm, E 20 kPa, nu 0.45, between bonded pads of 30 x 30 mm: force [N], von Mises stress [Pa] at 15 %."""

BONDED: References = {
    "force at 5 %": (4.917164, 0.0061),
    "force at 10 %": (10.325293, 0.0200),
    "force at 15 %": (16.266156, 0.0528),
    "energy at 15 %": (0.0464993, 9.7e-5),
    "von Mises, centre": (10260.9, 10.3),
    "von Mises, middle of a side": (7806.0, 13.8),
    "von Mises, half way up": (8696.9, 8.7),
}
"""Cube of 40 mm, E 50 kPa, nu 0.45, between bonded plates: force [N], energy [J], von Mises stress [Pa] at 15 %."""

SWING: References = {"lowest": (-0.0630516, 0.0003), "time of it": (0.149204, 0.001)}
"""Beam 0.1 x 0.02 x 0.02 m, E 100 kPa, nu 0.3, rho 1000, clamped at one end, let go under its weight: tip [m], [s]."""

TIP = np.array([
    0.0, -0.000490, -0.001934, -0.005274, -0.010560, -0.016962, -0.023806, -0.030145, -0.036515, -0.043021, -0.049141,
    -0.054329, -0.058305, -0.061185, -0.062658, -0.063049, -0.062517, -0.060916, -0.058191, -0.054095, -0.048844,
    -0.042670, -0.035984, -0.029384, -0.023143, -0.016795, -0.010459, -0.005156, -0.001517, -0.000026, 0.000069,
    -0.000742, -0.002545, -0.005587, -0.010677, -0.017126, -0.024141, -0.030913, -0.037210, -0.043461, -0.049347,
    -0.054604, -0.058480, -0.061264, -0.062840, -0.063088, -0.062443, -0.060619, -0.057898, -0.053869, -0.048591,
    -0.042409, -0.035392, -0.028893, -0.022354, -0.016348, -0.010483, -0.004957, -0.001469, 0.000501, 0.000275,
])  # fmt: skip
"""its tip every 10 ms [m]; Newmark at 2 ms, mesh and step extrapolated, +- 0.0003"""

HANGING: References = {
    "gravity, nu 0.3": (-0.0345404, 1.2e-5),
    "gravity, nu 0.495": (-0.0337740, 2.7e-5),
    "end force, nu 0.3": (-0.0421973, 8.8e-6),
}
"""The same beam at rest under its weight, or under 0.2 N spread over its end: tip [m]."""


def errors(found: Found, references: References) -> Found:
    """Of every quantity that has a reference, relative."""
    return {name: found[name] / value - 1.0 for name, (value, _) in references.items()}


def fitted_order(sizes: Sequence[float], wrong: Sequence[float]) -> float:
    """Slope of log |error| over log size."""
    return float(np.polyfit(np.log(sizes), np.log(np.abs(wrong)), 1)[0])
