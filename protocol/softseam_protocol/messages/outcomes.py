"""What messages say in one word, for programs to act on; texts beside them are for people, and nothing reads those."""

import math
from enum import StrEnum


class Status(StrEnum):
    """What became of a participant's step; `Advanced.why` says it in words, with the remedy."""

    CONVERGED = "converged"
    REFUSED = "refused"
    """the request cannot be served"""
    UNCONVERGED = "unconverged"
    """the equations were not solved"""
    DIVERGED = "diverged"
    """numbers grew beyond all bounds"""
    DOUBTFUL = "doubtful"
    """there is a state, which the participant does not believe"""


class FailureKind(StrEnum):
    """Why a request is not served; `Failure.message` says it in words, with the remedy."""

    NOT_CONFIGURED = "not_configured"
    """no such session, or no such part in it"""
    STALE = "stale"
    """the request is from the past"""
    SCHEMA = "schema"
    """another version of the messages"""
    INVALID = "invalid"
    """the request cannot be served as it is; nothing has changed"""
    BUSY = "busy"
    """too much is under way"""
    INTERNAL = "internal"
    """a participant is lost for good, or a step failed"""
    DISK = "disk"
    """a file cannot be written"""


class RecordingState(StrEnum):
    """How a recording fares; `Recorded.note` says in words why messages are lost."""

    RECORDING = "recording"
    CLOSED = "closed"
    """the file has its end"""
    FAILED = "failed"
    """the file ends before the session did"""


class EventKind(StrEnum):
    """What an event is about."""

    ACCURACY = "accuracy"
    """the estimated error is too large"""
    BREAKS = "breaks"
    """a body bears more than its material's strength; nothing breaks"""
    BUS = "bus"
    """what exchanges cost"""
    CELLS = "cells"
    """cells pass to full quadrature"""
    CREEP = "creep"
    """a body creeps along tools that stand still"""
    DAMPED = "damped"
    """steps damp a bounce or a swing"""
    ELEMENT = "element"
    """the element is too stiff for the material"""
    ENERGY = "energy"
    """an alarm of the ledger"""
    FORCE = "force"
    """a phase ends off its force"""
    GONE = "gone"
    """a body left the scene, or came out behind a tool"""
    KEPT = "kept"
    """the session is not kept on disk: it would end with its orchestrator"""
    LOST = "lost"
    """the step that its header names counts, but what follows it was not done"""
    MONITOR = "monitor"
    """what a participant's monitor saw"""
    NOT_DONE = "not_done"
    """what the scene asks for and the run did not do"""
    OVERLAP = "overlap"
    """bodies that nothing keeps apart pass through one another"""
    PARTICIPANT_LOST = "participant_lost"
    PARTICIPANT_RESTORED = "participant_restored"
    RECORDING = "recording"
    REFUSED = "refused"
    """a switch of regions was taken back"""
    REGIONS = "regions"
    """regions switch"""
    RESTORED = "restored"
    """the simulation is back at a saved state"""
    SEAM = "seam"
    """the sides did not agree at once"""
    SLEEP = "sleep"
    """bodies that were asleep wake"""
    SOLVER = "solver"
    """a step was kept that had not converged"""
    STEP = "step"
    """FEM took the step in parts, of which the event has the number"""
    TOOLS = "tools"


class Detail(StrEnum):
    """What an event or an alarm says besides its kind."""

    CONTACT = "contact"
    """contact does more work than the tools' motion puts in"""
    CREATED = "created"
    """energy from nowhere"""
    GAP_KEPT = "gap_kept"
    """a step was committed with a gap at the seam that is too large"""
    INSIDE_OUT = "inside_out"
    """cells or tetrahedra are"""
    MET = "met"
    """tools have met"""
    PARTS = "parts"
    """the seam was stepped in parts"""
    PIERCED = "pierced"
    """a tool is inside a body, and nothing touches it"""
    REPEATED = "repeated"
    """the step was repeated with more substeps"""
    SEAM_WORK = "seam_work"
    """the seam does work"""
    SHORTER = "shorter"
    """shorter substeps from here on"""
    SWEEPS = "sweeps"
    """more sweeps in this step"""
    SWITCH = "switch"
    """a switch of regions changed the energy"""
    TOO_FAR = "too_far"
    """a tool moves too far in a step"""
    UNCONVERGED = "unconverged"
    """the residual is large"""
    UNFINISHED = "unfinished"
    """the residual that the scene asks for was not reached"""


class Figure(StrEnum):
    """What a participant says of a step in numbers that not every one has (`Advanced.extras`)."""

    BENDING_ENERGY = "bending_energy"
    """of particles [J]"""
    BENDING_VIOLATION = "bending_violation"
    """of particles: farthest that a bend is from its own law, relative to the particles' spacing [1]"""
    BENDING_VIOLATION_MEAN = "bending_violation_mean"
    BLENDED = "n_blended"
    """cells squeezed so far that they count in part with full quadrature"""
    CONTACTS = "n_contacts"
    """surface points that touch a tool"""
    DISSIPATED = "dissipated"
    """what a material with internal state dissipated in the step [J]"""
    FASTEST = "fastest"
    """speed of the fastest node as the step ends [m/s]"""
    GIVEN = "given"
    """energy that the step gave back to a body that turns, beside `Advanced.tool_work` [J]"""
    HELD = "held"
    """particles that tools hold"""
    ITERATIONS = "iterations"
    """Newton iterations, or sweeps"""
    PASSING = "passing"
    """energy that cells gained as the step began by passing to full quadrature or from it, which nothing did [J]"""
    PENETRATION = "penetration"
    """deepest penetration of a surface point into a tool [m]"""
    REJECTED = "n_rejected"
    """substeps that were taken and given up, because their error was too large"""
    RESIDUAL = "residual"
    """what the stress of XPBD's blocks lacks to that of their shapes at the end of the step, relative [1]"""
    SLIP = "slip"
    """largest accumulated slip of a touching point on a moving tool [m]"""
    STEP_ERROR = "step_error"
    """largest estimated error in position that a substep made in time [m]"""
    STRETCH_ENERGY = "stretch_energy"
    """of particles [J]"""
    STRETCH_VIOLATION = "stretch_violation"
    """of particles: farthest that a spring is from its own law, relative to its length [1]"""
    STRETCH_VIOLATION_MEAN = "stretch_violation_mean"
    SUBSTEPS = "n_substeps"
    """steps of the participant's own that the motion is made of"""
    WORST_STRETCH = "worst_stretch"
    """of particles: largest change of length of a spring, relative, or largest strain of a tetrahedron [1]"""


TOO_FAR_OFF = 0.05
"""error above which a run says that it is not to be trusted [1]"""
_SHORTEST = 0.25
"""least factor of cells and steps that is advised [1]"""


def shorter(error: float) -> float:
    """Factor of cells and steps for an error of second order in both [1] to be `TOO_FAR_OFF`."""
    return max(_SHORTEST, math.sqrt(TOO_FAR_OFF / error))


ONE_AT_LEAST = frozenset({Figure.ITERATIONS, Figure.SUBSTEPS})
"""figures that are 1 where they are left out; others are 0"""
SPENT = frozenset(
    {Figure.DISSIPATED, Figure.GIVEN, Figure.ITERATIONS, Figure.PASSING, Figure.REJECTED, Figure.SUBSTEPS}
)
"""figures that add up over the parts of a step; others say how things stand as it ends, or the most that there was"""
