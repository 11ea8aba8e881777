# %% [markdown]
# # 2. Classic PBD: its stiffness follows the iterations
#
# Position-based dynamics moves points until constraints are met. A constraint's *stiffness* k is the share of its error
# that one sweep takes away; after n sweeps (1 - k)^n of it is left. So the material is a matter of n. XPBD gives each
# constraint a compliance instead, and more sweeps only bring it closer to one and the same answer.
#
# A rope of a metre hangs between two grippers that come closer; by how much is it stretched in the end?

# %%
import sys

import matplotlib.pyplot as plt

import softseam

SWEEPS = (1, 3, 9, 27)
ROPE = ["body.stretch=10", "body.damping=4"]


def stretched(settings: list[str]) -> float:
    """Largest strain of a segment at the end [1]."""
    with softseam.open("rope", settings=[*ROPE, *settings]) as sim:
        sim.reset()
        return sim.run().quantities["worst_stretch"]


# %%
classic = [
    stretched(
        ["models.pbd.method=pbd", "models.pbd.classic.stretch=0.1", "models.pbd.substeps=4", f"models.pbd.sweeps={n}"]
    )
    for n in SWEEPS
]
xpbd = [stretched([f"models.pbd.sweeps={n}"]) for n in SWEEPS]

# %%
plt.loglog(SWEEPS, [100 * strain for strain in classic], "o-", label="classic PBD, k = 0.1")
plt.loglog(SWEEPS, [100 * strain for strain in xpbd], "s-", label="XPBD, E A = 10 N")
plt.xlabel("sweeps a substep")
plt.ylabel("largest strain [%]")
plt.title("A rope that hangs")
plt.legend()
plt.savefig(sys.argv[1] if len(sys.argv) > 1 else "pbd_stiffness.png", dpi=120, bbox_inches="tight")

# %% [markdown]
# Three times the sweeps, a third of the strain: classic PBD has no stiffness of its own. XPBD stays where it is.

# %%
spread = {"classic": max(classic) / min(classic), "xpbd": max(xpbd) / min(xpbd)}
print(
    f"1 to 27 sweeps: the strain changes {spread['classic']:.0f}-fold by classic PBD, {spread['xpbd']:.2f}-fold by XPBD"
)
assert spread["classic"] > 5.0, "the stiffness of classic PBD follows its sweeps"
assert spread["xpbd"] < 1.3, "that of XPBD does not"
