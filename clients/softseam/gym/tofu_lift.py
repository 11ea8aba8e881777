"""The reference job: lift a block of tofu, however soft it may be, and press it no more than that needs."""

import math
from collections.abc import Sequence
from typing import Unpack

from softseam.errors import BadInput
from softseam.gym.lift_scene import BY_FEM, BY_XPBD, SUBSTEPS, LiftModel, settings_of
from softseam.gym.pad_lift import Floats, PadLift
from softseam.gym.randomise import Randomise
from softseam.gym.reward import GENTLE, Grip, Term
from softseam.gym.task_env import ACT, Given, parts_of_an_action
from softseam_protocol.models import FAR_DEFAULT, REFERENCE


class TofuLift(PadLift):
    """Two pads grip a block of tofu and lift it by 3 cm, within 3.2 s.

    An action has two numbers from -1 to 1: how fast each pad closes and both rise, in parts of 5 cm/s, for 0.04 s. Pads
    open no wider than they began and sink no lower. Seen is what a robot could measure, `SEEN`: the pads' ways, their
    forces, how much of them touches, and a marker in the middle of the tofu's top. `info` has what it could not: the
    piece's constants, stress, compression, lift.

    An episode ends with 1 where the tofu is lifted, and with -1 where it is squeezed by half, or where a step finds no
    solution; each step costs 0.002. `info["ending"]` says which: "lifted", "crushed", "failed", or "time".

    reward        terms that are rewarded beside; see `softseam.gym.reward`
    randomise     how pieces differ; None: not at all
    model         FEM, or XPBD as `BatchEnv` has it
    step          of the simulation: a whole part of 0.04 s. Learn at 0.04, judge at 0.01 [s]
    environments  that learn together: weights that grow with training count the steps of all of them
    """

    def __init__(
        self,
        *,
        reward: Sequence[Term[Grip]] = GENTLE,
        randomise: Randomise | None = Randomise(),  # noqa: B008 - it is frozen
        model: LiftModel = BY_FEM,
        step: float = ACT,
        settings: Sequence[str] = (),
        **given: Unpack[Given],
    ) -> None:
        """Other arguments as of `Given`, and for `SceneEnv`."""
        if model not in (BY_FEM, BY_XPBD) or (model == BY_XPBD and parts_of_an_action(step) > 1):
            raise BadInput(f"model={model!r}, step={step!r}: there are fem, and xpbd with steps of {ACT} s")
        self._lift_model = model
        super().__init__(
            "tofu_grasp",
            step=step,
            model=FAR_DEFAULT if model == BY_XPBD else REFERENCE,
            settings=(*settings_of(model, step), *settings),
            reward=reward,
            randomise=randomise,
            **given,
        )
        if model == BY_XPBD:
            self._randomise.check_substep(self.scene, ACT / SUBSTEPS)

    def points_of_face(self, surface: Floats) -> int:
        low, high = surface[:, 0].min(), surface[:, 0].max()
        on_face = int((surface[:, 0] < low + 1e-3 * (high - low)).sum())
        if self._lift_model == "xpbd":  # of whole cells only the corners touch
            on_face = ((math.isqrt(on_face) + 1) // 2) ** 2
        return on_face
