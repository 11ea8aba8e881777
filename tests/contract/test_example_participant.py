"""What the example participant takes of a scene, and what it refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from faulty_participants import Example

from softseam.conform.examined_part import EDGE, FAR_END, mesh
from softseam_protocol.errors import Refused
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.names import within
from softseam_protocol.messages.participant import Configure, Configured, Observe
from softseam_protocol.scene.file import bundle_scene
from softseam_protocol.scene.scene import Scene
from softseam_protocol.wire.codec import decode, encode

SOFT = {"young": 1e4, "poisson": 0.3, "density": 1000.0}


def configure(body: str, /, **bodies: dict[str, Any]) -> Configure:
    """The far part of this body of a scene, which has one `body` or several."""
    shape = {"shape": {"kind": "block", "size": (2 * EDGE, EDGE, EDGE)}, "cell": EDGE, "material": SOFT}
    all_of_them = {name: shape | more for name, more in bodies.items()}
    told = {"body": all_of_them["body"]} if list(bodies) == ["body"] else {"bodies": all_of_them}
    scene = Scene.model_validate({"softseam": 1, "name": "two", "step": 0.002, "duration": 1.0} | told)
    header = Header(SCHEMA_VERSION, "here", within(body, "far"), 0, 0, 0, 0.0)
    return Configure(
        header, bundle_scene(scene), "fem", np.arange(2, dtype=np.int32), FAR_END, None, True, body, mesh()
    )


def test_each_of_several_bodies_has_its_own_material() -> None:
    participant = Example()
    stiff = {"material": SOFT | {"young": 3e4}, "position": (0.5, 0.0, 0.0)}
    for name in ("soft", "stiff"):
        request = configure(name, soft={}, stiff=stiff)
        assert isinstance(decode(participant(encode(request))), Configured)
    soft, hard = (participant.slots["here", f"{name}.far"].solver.part for name in ("soft", "stiff"))
    np.testing.assert_allclose(hard.K, 3.0 * soft.K, atol=1e-9 * np.abs(hard.K).max())


def test_a_body_that_is_thrown_flies() -> None:
    participant, request = Example(), configure("body", body={"velocity": (0.0, 0.0, 1.5)})
    participant(encode(request))
    np.testing.assert_array_equal(decode(participant(encode(Observe(request.header)))).v[:, 2], 1.5)


@pytest.mark.parametrize(
    "more", [{"spin": (0.0, 0.0, 1.0)}, {"material": SOFT | {"retardation_time": 0.01}}], ids=["spin", "viscous"]
)
def test_what_it_has_not_is_refused(more: dict[str, Any]) -> None:
    with pytest.raises(Refused, match="leave this body to fem or pbd") as refusal:
        Example()(encode(configure("body", body=more)))
    assert refusal.value.failure.kind == "invalid"
