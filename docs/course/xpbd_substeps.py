# %% [markdown]
# # 3. XPBD: the error against substeps
#
# A step of XPBD is cut into substeps, each with one sweep over the constraints. Many short substeps do better than many
# sweeps (Macklin et al., Small steps in physics simulation, 2019). How fast does the error fall?
#
# The beam of lesson 1 is let go and swings. softseam watches the constraints and takes more substeps where those asked
# for leave them unmet, so that fewer than some 16 change little here. `auto`, the default, chooses by itself.

# %%
import sys

import matplotlib.pyplot as plt
import numpy as np

import softseam

SUBSTEPS = (16, 32, 64, 128, 256)
FINEST = 1024


def swing(substeps: int) -> np.ndarray:
    """Deflection of the tip after every step of 10 ms [m]."""
    settings = [f"models.pbd.substeps={substeps}", "step=0.01", "duration=0.5"]
    deflections = []
    with softseam.open("cantilever", model="pbd", settings=settings) as sim:
        sim.reset()
        while not sim.done:
            deflections.append(sim.step().quantities["tip_deflection"])
    return np.array(deflections)


# %%
truth = swing(FINEST)
errors = [float(np.linalg.norm(swing(n) - truth) / np.linalg.norm(truth)) for n in SUBSTEPS]
plt.loglog(SUBSTEPS, [100 * error for error in errors], "o-", label="XPBD")
plt.loglog(SUBSTEPS, [100 * errors[0] * SUBSTEPS[0] / n for n in SUBSTEPS], ":", label="first order")
plt.xlabel("substeps a step of 10 ms")
plt.ylabel(f"deflection off that with {FINEST} substeps [%]")
plt.title("A beam that swings, by XPBD")
plt.legend()
plt.savefig(sys.argv[1] if len(sys.argv) > 1 else "xpbd_substeps.png", dpi=120, bbox_inches="tight")

# %% [markdown]
# Substeps half as long, half the error: XPBD is implicit Euler, whose velocities are a substep late. What is left then
# is the cells': compare with `model="fem"`, or halve `body.cell`.

# %%
for n, error in zip(SUBSTEPS, errors, strict=True):
    print(f"{n:4d} substeps: {100 * error:.2g} % off")
order = float(np.log2(errors[2] / errors[4]) / 2.0)
print(f"from 64 to 256 the error falls with order {order:.1f} of the substep's length")
assert 0.8 < order < 1.4, "first order"
