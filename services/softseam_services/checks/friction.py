"""Friction that varies between points that touch."""

from collections.abc import Iterator

from softseam_protocol.scene.friction_field import FrictionFieldSpec
from softseam_services.body.contact_points import is_embedded
from softseam_services.to_check import Cells, Particles


def look(seen: Cells) -> Iterator[str]:
    apart = float(seen.body.edges.max()) * (0.25 if is_embedded(seen.body) else 0.5)
    return _between(seen.scene.body.uneven_friction, apart, "shorter cells")


def look_at_particles(seen: Particles) -> Iterator[str]:
    """The same of a body of particles."""
    return _between(seen.scene.body.uneven_friction, seen.body.spacing, "more divisions")


def _between(field: FrictionFieldSpec | None, apart: float, finer: str) -> Iterator[str]:
    """Points are so far apart [m]; finer: what brings them nearer."""
    if field is not None and field.length < apart:
        yield (
            f"body.friction_field.length: friction varies over {1e3 * field.length:.3g} mm, and points that touch "
            f"tools are {1e3 * apart:.3g} mm apart, each of which stands for what is around it: give a longer length, "
            f"or {finer}"
        )
