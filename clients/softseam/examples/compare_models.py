"""The same scene with FEM alone, PBD alone and both: how far apart are they, and what does each cost?

python -m softseam.examples.compare_models
"""

from time import perf_counter

import softseam
from softseam.variants import models


def main() -> None:
    print("model    grip [N]  lift [mm]  slip [mm]  RTF")
    for model in models():
        with softseam.open("tofu_grasp", model=model) as sim:
            sim.reset()
            sim.step()  # the first step compiles
            began = perf_counter()
            obs = sim.run()
            rtf = obs.time / (perf_counter() - began)
            quantities = f"{obs.grip_force:8.2f}  {1e3 * obs.lift_height:9.2f}  {1e3 * obs.slip:9.3f}"
            print(f"{model:7s}  {quantities}  {rtf:4.1f}")


if __name__ == "__main__":
    main()
