# %% [markdown]
# # 4. One body, two models, and the multiplier between them
#
# Where the plates touch, the block is FEM; its far field is XPBD. At the *seam* between them both have nodes in the
# same places, and a multiplier lambda, a force at every node, keeps these together. It pulls one side as it pushes the
# other, so that momentum is exact, and the gap says how well it did.

# %%
import sys

import matplotlib.pyplot as plt

import softseam

COLUMNS = ("time", "grip", "gap", "lambda", "work")


def run(model: str) -> dict[str, list[float]]:
    """What is seen after every step."""
    seen: dict[str, list[float]] = {name: [] for name in COLUMNS}
    with softseam.open("tofu_grasp", model=model, settings=["duration=2"]) as sim:
        sim.reset()
        while not sim.done:
            obs = sim.step()
            row = (obs.time, obs.grip_force, obs.seam.gap, obs.seam.force, obs.seam.work)
            for name, value in zip(COLUMNS, row, strict=True):
                seen[name].append(value)
    return seen


# %%
both, fem = run("hybrid"), run("fem")
_, axes = plt.subplots(3, 1, sharex=True, figsize=(6, 7))
axes[0].plot(fem["time"], fem["grip"], label="FEM alone")
axes[0].plot(both["time"], both["grip"], "--", label="FEM and XPBD")
axes[0].set_ylabel("grip force [N]")
axes[0].legend()
axes[1].plot(both["time"], both["lambda"])
axes[1].set_ylabel("largest lambda [N]")
axes[2].semilogy(both["time"], [max(1e6 * gap, 1e-6) for gap in both["gap"]])
axes[2].set_ylabel("gap at the seam [um]")
axes[2].set_xlabel("time [s]")
plt.savefig(sys.argv[1] if len(sys.argv) > 1 else "two_models.png", dpi=120, bbox_inches="tight")

# %% [markdown]
# lambda is zero until the seam closes between the models, grows with the squeeze, and carries the far field's weight in
# the lift. It does no work, but for what the gap lets slip. Move the seam: `settings=["regions.near.within=0.012"]`.

# %%
strongest = max(fem["grip"])
off = max(abs(a - b) for a, b in zip(both["grip"], fem["grip"], strict=True)) / strongest
print(f"largest lambda {max(both['lambda']):.2f} N, widest gap {1e6 * max(both['gap']):.2f} um")
print(f"the force is off FEM's by {100 * off:.1f} %")
assert max(both["lambda"]) > 0.1, "the seam carries force"
assert max(both["gap"]) < 1e-4, "and stays closed"
assert off < 0.15, "both models come to what one does"
