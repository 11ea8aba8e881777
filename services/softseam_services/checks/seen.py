"""What checks of bodies look at."""

from typing import NamedTuple

from softseam_protocol.scene.bodies import AnyBody
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Body
from softseam_services.body.particles import ParticleBody
from softseam_services.tools.tool_set import ToolSet


class Cells(NamedTuple):
    """A body in cells: the scene with that body alone, what it says of the body, and its tools."""

    scene: Scene
    spec: AnyBody
    body: Body
    tools: ToolSet


class Particles(NamedTuple):
    """The same of a body of particles."""

    scene: Scene
    spec: AnyBody
    body: ParticleBody
    tools: ToolSet
