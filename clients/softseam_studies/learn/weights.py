"""A policy's weights, read alone: what stable-baselines3 saves beside them is pickled, code of whoever made the file.

Networks are those that `train` makes (docs/decisions/40, 59), so nothing but tensors is needed of a file.
"""

import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

from softseam.errors import BadInput
from softseam_studies.learn.policy import POLICY, TRAINING, Algorithm

NETWORK = {"net_arch": [64, 64]}
"""of every policy"""
VARIABLES = "pytorch_variables"
"""of its members, what is no state of a module or an optimiser: SAC's coefficient of the entropy"""
_ENDS = {
    "ppo": ("mlp_extractor.policy_net.0.weight", "action_net.weight"),
    "sac": ("actor.latent_pi.0.weight", "actor.mu.weight"),
}
"""weights of the first layer, which has a column for each number that is seen, and of the last: a row an action"""


def read_weights(saved: Path | BytesIO) -> dict[str, Any]:
    """Tensors by the names of their members, "policy" among them; what fails, fails by whatever PyTorch meets."""
    import torch

    with zipfile.ZipFile(saved) as archive:
        return {
            name.removesuffix(".pth"): torch.load(BytesIO(archive.read(name)), map_location="cpu", weights_only=True)
            for name in archive.namelist()
            if name.endswith(".pth")
        }


def go_on(learner: Any, algorithm: Algorithm, saved: Path, done: int) -> None:
    """Give a new learner the weights and the optimisers' memory of one that took `done` steps. Raises BadInput."""
    with _of_no_policy(algorithm):
        weights = read_weights(saved)
        variables = weights.pop(VARIABLES, {})
        if weights.keys() != learner.get_parameters().keys():
            raise ValueError("others than this algorithm's")
        learner.set_parameters(weights, exact_match=True, device="cpu")
        if algorithm == "sac":
            learner.log_ent_coef.data.copy_(variables["log_ent_coef"].data)
    learner.num_timesteps = done


def load_policy(algorithm: Algorithm, saved: BytesIO, env: Any) -> Any:
    """The network, which sees and does what env shows and takes. Raises BadInput where it is none of env."""
    import stable_baselines3

    seen, done = env.observation_space, env.action_space
    kind = {"ppo": stable_baselines3.ppo.MlpPolicy, "sac": stable_baselines3.sac.MlpPolicy}[algorithm]
    policy = kind(seen, done, lambda part: 0.0, **NETWORK)
    with _of_no_policy(algorithm):
        weights = read_weights(saved)["policy"]
        first, last = (weights[name].shape for name in _ENDS[algorithm])
        if ((first[1],), (last[0],)) != (seen.shape, done.shape):
            raise BadInput(
                f"{POLICY} sees {(first[1],)} and gives {(last[0],)}, and {type(env).__name__} shows {seen.shape} "
                f"and takes {done.shape}: it is a policy of another task or version, train anew"
            )
        policy.load_state_dict(weights)
    return policy


@contextmanager
def _of_no_policy(algorithm: Algorithm) -> Iterator[None]:
    """What a file that does not hold what its training.json says ends in, whatever PyTorch meets in it."""
    try:
        yield
    except BadInput:
        raise
    except Exception as error:
        raise BadInput(
            f"{POLICY} is no policy that {algorithm} learned, or one of another task ({type(error).__name__}): was it "
            f"or {TRAINING} copied from another folder? Train anew"
        ) from error
