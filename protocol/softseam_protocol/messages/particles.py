"""What a body of particles reports of itself beside what every part does."""

from softseam_protocol.messages.arrays import Count
from softseam_protocol.messages.message import message


@message
class ParticleReport:
    """How well the constraints of a body of particles are met at the end of a step."""

    worst_stretch: float
    """largest change of length of a spring, relative, or largest strain of a tetrahedron [1]"""
    stretch_violation: float
    """farthest that a spring is from its own law, relative to its length [1]"""
    stretch_violation_mean: float
    bending_violation: float
    """farthest that a bend is from its own law, relative to the particles' spacing [1]"""
    bending_violation_mean: float
    stretch_energy: float
    """[J]"""
    bending_energy: float
    """[J]"""
    held: Count
    """particles that tools hold"""
