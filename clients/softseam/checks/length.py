"""Runs that nobody waits for, that go on long after their motion, or in which a viscosity lets nothing move."""

from collections.abc import Iterator

from softseam.duration import expected_duration
from softseam.to_check import Written

_MANY_STEPS = 100_000
"""more steps take hours, of whatever body"""


def look(seen: Written) -> Iterator[str]:
    scene, length = seen.scene, expected_duration(seen.scene)
    if length is not None:
        time = seen.body.cell_materials[0].retardation_time if seen.body.has_cells else 0.0
        if time > length:
            yield (
                f"body.material.retardation_time: {time:g} s, but the motion lasts {length:.3g} s: next to nothing "
                "would move; is it in s?"
            )
        if length / scene.step > _MANY_STEPS:
            yield (
                f"step: {scene.step:g} s are {length / scene.step:,.0f} steps in {length:.4g} s, which take hours; are "
                "both in s, not in ms or us?"
            )
            return
    motion = expected_duration(scene.model_copy(update={"duration": None})) if scene.motion else None
    if scene.duration is not None and motion is not None and scene.duration > max(60.0, 30.0 * motion):
        yield f"duration: {scene.duration:.4g} s, but the motion is over after {motion:.3g} s; is it in s, not in ms?"
