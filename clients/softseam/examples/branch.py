"""Try three grips from the same moment: a snapshot is taken once and restored for each of them.

python -m softseam.examples.branch
"""

import softseam


def main() -> None:
    with softseam.open("tofu_grasp", model="pbd") as sim:
        sim.reset(seed=0)
        sim.step({"left": [0.02, 0.0, 0.0], "right": [-0.02, 0.0, 0.0]}, count=70, fields=False)
        start = sim.snapshot()
        for speed in (0.01, 0.02, 0.04):
            sim.restore(start)
            obs = sim.step({"left": [speed, 0.0, 0.0], "right": [-speed, 0.0, 0.0]}, count=20)
            print(f"{1e3 * speed:.0f} mm/s for 0.2 s: grip {obs.grip_force:.2f} N, peak {obs.von_mises.max():.0f} Pa")


if __name__ == "__main__":
    main()
