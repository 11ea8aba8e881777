"""Scenes as environments of Gymnasium, for reinforcement learning.

>>> import gymnasium
>>> env = gymnasium.make("softseam.gym:softseam/TofuLift-v0")
>>> seen, info = env.reset(seed=0)
>>> seen, reward, terminated, truncated, info = env.step([0.4, 0.0])   # close at 2 cm/s
"""

from typing import NoReturn

from softseam.errors import missing_extra

try:
    import gymnasium
except ModuleNotFoundError as error:
    raise missing_extra(error, "softseam.gym") from error

from softseam.gym.batch_env import BatchEnv
from softseam.gym.point_cloud import PointCloud
from softseam.gym.push_gentle import PushGentle
from softseam.gym.randomise import Randomise
from softseam.gym.scene_env import SceneEnv
from softseam.gym.slice_lift import SliceLift
from softseam.gym.tofu_lift import TofuLift
from softseam.gym.towel_fold import TowelFold

__all__ = ["BatchEnv", "PointCloud", "PushGentle", "Randomise", "SceneEnv", "SliceLift", "TofuLift", "TowelFold"]

gymnasium.register(
    id="softseam/TofuLift-v0",
    entry_point="softseam.gym.tofu_lift:TofuLift",
    vector_entry_point="softseam.gym.batch_env:BatchEnv",
)
gymnasium.register(id="softseam/SliceLift-v0", entry_point="softseam.gym.slice_lift:SliceLift")
gymnasium.register(id="softseam/PushGentle-v0", entry_point="softseam.gym.push_gentle:PushGentle")
gymnasium.register(id="softseam/TowelFold-v0", entry_point="softseam.gym.towel_fold:TowelFold")


def _no_tofu_grasp(**_: object) -> NoReturn:
    raise gymnasium.error.DeprecatedEnv(
        "softseam/TofuGrasp-v0 is no more: make softseam/TofuLift-v0, which shows and rewards other things"
        " (docs/start/training.md); a policy of the old one has to be trained anew"
    )


gymnasium.register(id="softseam/TofuGrasp-v0", entry_point=_no_tofu_grasp)
