"""How far a body reaches at rest."""

from softseam_services.body.body import Body, Floats
from softseam_services.body.interpolate import rest_points
from softseam_services.body.particles import ParticleBody


def bounding_points(body: Body | ParticleBody) -> Floats:
    """Points at rest whose box is the body's (n, 3) [m]: where its surface cuts cells those of the surface, for cells'
    nodes may be outside of it; else its nodes, or particles."""
    return rest_points(body) if body.cut else body.x_rest
