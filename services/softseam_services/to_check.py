"""What checks of bodies look at."""

from typing import NamedTuple

from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.particles import ParticleBody
from softseam_services.tools.tool_set import ToolSet


class Cells(NamedTuple):
    """A body in cells: the scene with that body alone, and its tools."""

    scene: Scene
    body: Body
    tools: ToolSet


class Particles(NamedTuple):
    """The same of a body of particles."""

    scene: Scene
    body: ParticleBody
    tools: ToolSet
