"""A scene whose configurations are run, each once, and compared with its reference."""

from dataclasses import dataclass
from pathlib import Path

from softseam.embedded import solver_digest
from softseam.errors import BadInput, require_extra
from softseam.scenes import bundle_of, bundle_with
from softseam.variants import AS_GIVEN, with_settings
from softseam_protocol.facts import machine
from softseam_protocol.scene.file import scene_hash
from softseam_protocol.scene.scene import Scene
from softseam_studies.study.bundled import bundled
from softseam_studies.study.errors import KNOWN
from softseam_studies.study.frame import Frame, frame_of
from softseam_studies.study.levels import Levels, ParticleLevels, Watch
from softseam_studies.study.measure import quantity_names
from softseam_studies.study.reference import TARGET, Reference
from softseam_studies.study.refine import refine
from softseam_studies.study.store import Identity


@dataclass(frozen=True)
class Study:
    """A scene, and what its runs go by."""

    name: str | Path | Scene
    """as it was asked for"""
    settings: tuple[str, ...]
    """each in place of what the scene says"""
    scene: Scene
    """with them, and without a tolerance"""
    frame: Frame
    identity: Identity
    """of its runs"""

    def names(self, wanted: tuple[str, ...] = ()) -> tuple[str, ...]:
        """The quantities to compare: those wanted, or all that the scene has. Raises BadInput."""
        there = quantity_names(self.scene)
        for name in wanted:
            if name not in there:
                raise BadInput(f"--quantity {name}: the scene {self.scene.name!r} observes {', '.join(there)}")
        return wanted or there

    def levels(self, names: tuple[str, ...], *, fresh: bool = False) -> Levels:
        """Of its reference, in these quantities."""
        kind = Levels if self.frame.body.has_cells else ParticleLevels
        found = kind(self.name, self.settings, self.frame, names)
        found.open(self.identity.code, fresh=fresh)
        return found


def study_of(name: str | Path | Scene, settings: tuple[str, ...] = ()) -> Study:
    """Read a scene, and measure its body. Raises SceneRefused and BadInput."""
    require_extra("solve", "simulating in this process")
    loaded, bundle = bundle_of(name)
    settings = (*settings, *AS_GIVEN)
    scene = with_settings(loaded, settings)
    key = scene_hash(bundle_with(scene, bundle, name, settings))
    return Study(name, settings, scene, frame_of(scene, name, settings), Identity(key, solver_digest(), machine()))


def reference_of(
    levels: Levels, budget: float, watch: Watch, target: float = TARGET, known: float = KNOWN
) -> Reference:
    """What comes with the scene, or what its levels lead to within a budget of processor time [s]; see `refine`."""
    return bundled(levels, target, known) or refine(levels, budget, watch, target, known)
