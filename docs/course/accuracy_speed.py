# %% [markdown]
# # 5. Accuracy against speed
#
# A model no finer than a scene needs: how does one find it? By a picture. Every configuration is a point: to the right
# is faster, down is more accurate. What others beat in both is not worth a thought; what is left is the *front*.
# `softseam chart` draws it with many more configurations, `softseam plan` walks along it to a tolerance.

# %%
import sys
from time import process_time

import matplotlib.pyplot as plt
import numpy as np

import softseam

WAYS = {
    "FEM 2x2x2, 40 ms": ("fem", ["body.cell=0.025", "step=0.04"]),
    "FEM 2x2x2, 10 ms": ("fem", ["body.cell=0.025", "step=0.01"]),
    "FEM 3x3x3, 10 ms": ("fem", ["body.cell=0.016667", "step=0.01"]),
    "FEM 4x4x4, 10 ms": ("fem", ["body.cell=0.0125", "step=0.01"]),
    "XPBD 3x3x3, 10 ms": ("pbd", ["body.cell=0.016667", "step=0.01"]),
    "XPBD 5x5x5, 10 ms": ("pbd", ["body.cell=0.01", "step=0.01"]),
    "both 3x2x2, 10 ms": ("hybrid", ["step=0.01"]),
}
TRUTH = ("fem", ["body.cell=0.00833333", "step=0.005"])
TIMES = np.linspace(0.04, 1.2, 30)
"""at which curves are compared [s]"""


def curve(model: str, settings: list[str]) -> tuple[np.ndarray, float]:
    """Grip force at TIMES [N], and processor time per simulated second."""
    with softseam.open("tofu_grasp", model=model, settings=[*settings, "duration=1.2"]) as sim:
        sim.reset()
        sim.step()  # the first step loads what is compiled
        sim.reset()
        began, times, forces = process_time(), [0.0], [0.0]
        sim.run(lambda seen: (times.append(seen.time), forces.append(seen.grip_force)))
        return np.interp(TIMES, times, forces), (process_time() - began) / times[-1]


# %%
truth, _ = curve(*TRUTH)
points = {}
for name, way in WAYS.items():
    force, cost = curve(*way)
    points[name] = 1.0 / cost, float(np.linalg.norm(force - truth) / np.linalg.norm(truth))
    print(f"{name:18s} {points[name][0]:7.1f} times real time, {100 * points[name][1]:5.2f} % off")

# %%
for name, (speed, error) in points.items():
    plt.loglog(speed, 100 * error, "o")
    plt.annotate(name, (speed, 100 * error), textcoords="offset points", xytext=(5, 4), fontsize=8)
plt.xlabel("times real time, one core")
plt.ylabel("grip force: error against finer FEM [%]")
plt.title("Seven ways to grasp a block of tofu")
plt.savefig(sys.argv[1] if len(sys.argv) > 1 else "accuracy_speed.png", dpi=120, bbox_inches="tight")

# %%
front = [one for one, (speed, error) in points.items() if not any(s > speed and e < error for s, e in points.values())]
print("not beaten in both:", ", ".join(front))
assert 1 <= len(front) < len(points), "some ways are beaten in both"
assert points["FEM 4x4x4, 10 ms"][1] < points["FEM 2x2x2, 40 ms"][1], "finer is more accurate"
