"""Squeeze the tofu by hand: close both plates until the grip reaches 5 N, then read forces and stresses.

python -m softseam.examples.squeeze
"""

import softseam


def main() -> None:
    with softseam.open("tofu_grasp") as sim:
        obs = sim.reset(seed=0)
        while obs.grip_force < 5.0 and obs.step < 300:
            obs = sim.step({"left": [0.02, 0.0, 0.0], "right": [-0.02, 0.0, 0.0]})  # tool velocities [m/s]
            if obs.step % 20 == 0:
                print(f"t {obs.time:.2f} s  grip {obs.grip_force:5.2f} N  gap at the seam {1e6 * obs.seam.gap:.2f} um")
        print(f"peak von Mises stress {obs.von_mises.max():.0f} Pa, force on the left plate {obs.wrench['left'][:3]} N")


if __name__ == "__main__":
    main()
