"""Every check of the kit by name."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from softseam.conform import answers, motion, refusals, repeats
from softseam.conform.examined_part import Service
from softseam_protocol.messages.participant import Capabilities
from softseam_protocol.table import Table


@dataclass(frozen=True)
class Check:
    """Raises Unmet where the participant does not do what it must.

    claim  the capability that it is about; '' where every participant must pass
    """

    run: Callable[[Service], None]
    says: str
    claim: Literal["", "corrects"] = ""

    def claimed(self, able: Capabilities) -> bool:
        return not self.claim or bool(getattr(able, self.claim))


CHECKS: Table[Check] = Table(
    "conformance checks",
    {
        "repeat": Check(repeats.repeat, "the same request again gets the same bytes"),
        "redo": Check(repeats.redo, "a higher exchange starts again from the committed state"),
        "commit": Check(repeats.commit, "a new step commits the one before"),
        "discard": Check(repeats.discard, "a Commit of the tentative step itself discards it"),
        "restore": Check(repeats.restore, "a snapshot in a new session goes on with the same bits"),
        "release": Check(repeats.release, "a released session is forgotten"),
        "stale_step": Check(refusals.stale, "a step that was committed is refused"),
        "old_epoch": Check(refusals.epoch, "a request of an older epoch is refused"),
        "step_ahead": Check(refusals.ahead, "a step that does not follow is refused"),
        "unknown_session": Check(refusals.unknown, "a session that was not configured is refused"),
        "wrong_shape": Check(refusals.shape, "a force of another shape is refused"),
        "not_a_number": Check(refusals.nan, "NaN is refused"),
        "other_schema": Check(refusals.schema, "another schema version is refused"),
        "unknown_model": Check(refusals.model, "a model that it does not have is refused"),
        "foreign_state": Check(refusals.state, "a state that is none of its own is refused"),
        "garbage": Check(refusals.garbage, "bytes that are no message are refused"),
        "momentum": Check(motion.momentum, "momentum changes by dt (weight + forces)"),
        "angular_momentum": Check(motion.angular, "a free part keeps its angular momentum"),
        "energy": Check(motion.energy, "energies and work are those of the state"),
        "rigid_motion": Check(motion.rigid, "a rigid motion gives no force"),
        "uniform_stress": Check(motion.uniform, "patch test: a uniform stress stays uniform"),
        "compliance_definite": Check(answers.definite, "the compliance is reported, symmetric, positive definite"),
        "compliance_predicts": Check(answers.predicts, "the compliance predicts a small move"),
        "correct": Check(answers.corrects, "Correct moves as foreseen, and as redoing would", "corrects"),
        "correct_then": Check(answers.goes_on, "a step asked for with Correct is one asked for after it", "corrects"),
    },
)
