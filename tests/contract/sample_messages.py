"""Messages to encode and decode."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.outcomes import Figure, Status
from softseam_protocol.messages.participant import Advanced, Coupled, ToolMotion

HEADER = Header(SCHEMA_VERSION, "s", "near", 0, 3, 1, 0.02)
TOOLS = ToolMotion(np.zeros((2, 3)), np.zeros((2, 4)), np.zeros((2, 3)), np.zeros((2, 4)))


def advanced(n_seam: int = 4, **changes: Any) -> Advanced:
    rng = np.random.default_rng(1)
    message = Advanced(
        HEADER, Status.CONVERGED, rng.random((3, 6)), 1.0, 2.0, 3.0, 4.0, rng.random(3), rng.random(3),
        rng.random((2, 3)), 0.1, rng.random(64),
        Coupled(rng.random((n_seam, 3)), work=5.0, compliance=np.zeros((0, 1))),
        {Figure.CONTACTS: 5.0, Figure.ITERATIONS: 6.0, Figure.PENETRATION: 0.1, Figure.SLIP: 0.2},
    )  # fmt: skip
    return dataclasses.replace(message, **changes)
