"""What messages say in one word, for programs to act on; texts beside them are for people, and nothing reads those."""

from __future__ import annotations

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
    BUS = "bus"
    """what exchanges cost"""
    CELLS = "cells"
    """cells pass to full quadrature"""
    CREEP = "creep"
    """a body creeps along tools that stand still"""
    ELEMENT = "element"
    """the element is too stiff for the material"""
    ENERGY = "energy"
    """an alarm of the ledger"""
    FORCE = "force"
    """a phase ends off its force"""
    GONE = "gone"
    """a body left the scene, or came out behind a tool"""
    LOST = "lost"
    """the step that its header names counts, but what follows it was not done"""
    MONITOR = "monitor"
    """what a participant's monitor saw"""
    NOT_DONE = "not_done"
    """what the scene asks for and the run did not do"""
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
    SOLVER = "solver"
    """a step was kept that had not converged"""
    STEP = "step"
    """FEM took the step in parts, of which the event has the number"""
    TOOLS = "tools"


class Detail(StrEnum):
    """What an event or an alarm says besides its kind."""

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
