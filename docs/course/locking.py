# %% [markdown]
# # 1. Locking, seen and cured
#
# Food is nearly incompressible: Poisson's ratio is close to 1/2. A linear element that must keep its volume at every
# quadrature point has no freedom left to bend: it *locks*. A soft beam, clamped at one end, sinks under its own weight.
# How far, by element and Poisson's ratio?

# %%
import sys

import matplotlib.pyplot as plt

import softseam

RATIOS = (0.3, 0.4, 0.45, 0.49, 0.499)
ELEMENTS = {
    "hex8_full": "linear, full quadrature: locks",
    "hex8": "linear, cured",
    "hex27": "quadratic",
}


def sinks(element: str, ratio: float) -> float:
    """Deflection of the tip at rest [m]."""
    settings = [
        f"models.fem.element={element}",
        "models.fem.integrator=static",
        f"body.material.poisson={ratio}",
        "body.material.young=1e6",
        "step=0.1",
        "duration=0.1",
    ]
    with softseam.open("cantilever", model="fem", settings=settings) as sim:
        sim.reset()
        return sim.run().quantities["tip_deflection"]


# %%
curves = {element: [sinks(element, ratio) for ratio in RATIOS] for element in ELEMENTS}
for element, text in ELEMENTS.items():
    plt.semilogx([0.5 - ratio for ratio in RATIOS], [-1e3 * way for way in curves[element]], "o-", label=text)
plt.gca().invert_xaxis()
plt.xlabel("1/2 - Poisson's ratio")
plt.ylabel("the tip sinks by [mm]")
plt.title("Cantilever under its own weight, E = 1 MPa")
plt.legend()
plt.savefig(sys.argv[1] if len(sys.argv) > 1 else "locking.png", dpi=120, bbox_inches="tight")

# %% [markdown]
# The quadratic element tells how far the beam sinks, at every ratio. The uncured one loses most of that at 0.499, the
# cured one, of the same nodes, does not. Try `hex8_bbar` and `hex8_reduced`, and half the cells: `body.cell=0.0125`.

# %%
right = curves["hex27"][-1]
locked, cured = curves["hex8_full"][-1] / right, curves["hex8"][-1] / right
print(
    f"at 0.499 the uncured element sinks by {100 * locked:.0f} %, the cured one by {100 * cured:.0f} % of what is right"
)
assert locked < 0.6, "the uncured element locks"
assert abs(cured - 1.0) < 0.1, "the cured one does not"
