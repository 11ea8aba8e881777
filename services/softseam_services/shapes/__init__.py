"""One file a shape of tools and of inclusions; the table has one row a kind of the scene file."""

from softseam_protocol.table import Table
from softseam_services.shapes import box, capsule, cylinder, mesh, plane, sphere
from softseam_services.shapes.geometry import Geometry, Sameness
from softseam_services.shapes.shape import Shape, ShapeError

__all__ = ["SHAPES", "Geometry", "Sameness", "Shape", "ShapeError"]

SHAPES: Table[Shape] = Table(
    "shapes",
    {
        "plane": plane.SHAPE,
        "box": box.SHAPE,
        "sphere": sphere.SHAPE,
        "capsule": capsule.SHAPE,
        "cylinder": cylinder.SHAPE,
        "mesh": mesh.SHAPE,
    },
)
"""the shape of each specification in softseam_protocol.scene.tools.TOOLS and softseam_protocol.scene.parts.PARTS"""
