"""The solvers that come along, as one participant: what is built of a scene, and which solver a Configure asks for.

The order of requests is the protocol's (`softseam_protocol.participant.requests`).
"""

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from softseam_protocol.messages.names import ONLY_BODY
from softseam_protocol.messages.participant import Bundle, Configure, Configured
from softseam_protocol.models import MODELS, service_of, taking
from softseam_protocol.participant.requests import Participant
from softseam_protocol.participant.solver import Solver
from softseam_protocol.scene.apart import box_of
from softseam_protocol.scene.bodies import AnyBody as AnyBodySpec
from softseam_protocol.scene.file import scene_from_bundle
from softseam_protocol.scene.repeat import repeated
from softseam_protocol.scene.scene import Scene
from softseam_services.blas import use_one_thread
from softseam_services.bodies import AnyBody, build_any_body
from softseam_services.body.errors import ToolError
from softseam_services.body.interpolate import model_functions
from softseam_services.body.sampled_faces import SampledFaces, sampled_faces
from softseam_services.built import Built
from softseam_services.orchestrator.crowd import role_of, with_cells
from softseam_services.orchestrator.default_model import with_model
from softseam_services.solvers import SOLVERS
from softseam_services.tools.build import build_tools
from softseam_services.tools.symmetry import check_symmetry
from softseam_services.tools.tool_set import ToolSet

_BUNDLES_KEPT = 4

use_one_thread()  # every process that simulates loads this module: results do not depend on the number of cores


@dataclass(frozen=True)
class Setup:
    """What a bundle describes of one body, built once a process."""

    scene: Scene
    """with that body alone, and regions that name a model"""
    spec: AnyBodySpec
    """of the body"""
    body: AnyBody
    tools: ToolSet
    why: str = ""
    """why they name this model, where the scene itself names none"""

    def touched(self, others: float = math.inf) -> SampledFaces:
        """Its surface as other bodies touch it, whose nodes are so far from one another [m]. Raises SettingError where
        there is none."""
        model = self.scene.regions.default
        assert self.body.has_cells and model is not None
        return sampled_faces(self.body, model_functions(self.scene.models)[model], others)


def build_setup(bundle: Bundle, name: str = ONLY_BODY) -> Setup:
    """Scene, body of that name and tools of a bundle. Raises SceneError, MeshError, ToolError or SettingError, and
    KeyError where the scene has no such body."""
    whole = scene_from_bundle(bundle)
    scene, spec = whole.of(name), whole.bodies[name]
    role = role_of(whole, name) if scene.regions.default is None else None
    if role is not None:
        spec = with_cells(spec, role)
        scene = scene.model_copy(update={"body": spec})
    body = build_any_body(scene, spec, bundle.files)
    try:
        tools = build_tools(scene, body, bundle.files)
    except ToolError as error:
        if whole.one is not None:
            raise
        raise ToolError(f"{error}; {_whose(whole, name)}") from error
    if body.has_cells:
        check_symmetry(scene, body, tools)
    scene, why = with_model(scene, spec, body, tools, whole.is_joined(name), role)
    return Setup(scene, spec, body, tools, why)


def _whose(scene: Scene, name: str) -> str:
    """Which of several bodies a tool starts inside, and what else to do where it is a copy."""
    group = repeated(name)
    boxes = [box_of(body) for each, body in scene.bodies.items() if group and repeated(each) == group]
    known = np.array([box for box in boxes if box is not None])
    if not len(known):
        return f"that body is {name}"
    wide = " x ".join(f"{1e3 * side:.4g}" for side in np.ptp(known.reshape(-1, 3), axis=0))
    return f"that body is {name}, and all copies are {wide} mm: give them more room, or bodies.{group}.repeat less"


def build_solver(setup: Setup, request: Configure, built: Built) -> tuple[Solver, Configured]:
    """The solver that a Configure asks for, of what is built already. Imports only the model that is asked for.

    Raises ValueError for a model that is none, that is not solved here or cannot take the body.
    """
    model, body = request.model, setup.body
    if not body.has_cells and model not in taking("particles"):
        able = " and ".join(taking("particles"))
        raise ValueError(f"a {body.kind} is made of particles: the model {model!r} cannot take it, only {able} can")
    if model not in SOLVERS:
        if model in MODELS:
            raise ValueError(
                f"the model {model!r} is solved by the service {service_of(model)!r}, which is not softseam's own: run "
                "it beside the others (softseam up), and connect to them"
            )
        raise ValueError(f"no model is called {model!r}; there are: {', '.join(MODELS)}")
    return SOLVERS[model].build(setup, request, built)


class ParticipantServer(Participant):
    """Answers requests for any number of sessions by FEM and XPBD, and builds a scene's bodies once."""

    def __init__(self) -> None:
        super().__init__(self._solver)
        self._setups: dict[bytes, dict[str, Setup]] = {}  # in the order of their last use
        self._built = Built()

    def adopt(self, bundle: Bundle, setups: Mapping[str, Setup]) -> None:
        """Share set-ups, by their bodies, that the same process has built already."""
        self._setups_of(bundle).update(setups)

    def _solver(self, request: Configure) -> tuple[Solver, Configured]:
        setups, names = self._setups_of(request.bundle), request.bodies or [request.body]
        for name in [*names, *request.guests]:
            setups[name] = setups.get(name) or build_setup(request.bundle, name)
        if not request.bodies:
            return build_solver(setups[request.body], request, self._built)
        row = SOLVERS[request.model] if request.model in SOLVERS else None
        if row is None or row.build_pile is None:
            raise ValueError(f"the model {request.model!r} takes one body a part: configure each by itself")
        return row.build_pile([setups[name] for name in names], [setups[name] for name in request.guests], request)

    def _setups_of(self, bundle: Bundle) -> dict[str, Setup]:
        """What is built of a bundle, by body; those of the latest bundles are kept."""
        digest = _digest(bundle)
        setups = self._setups.pop(digest, {})
        while len(self._setups) >= _BUNDLES_KEPT:
            self._setups.pop(next(iter(self._setups)))
        self._setups[digest] = setups
        return setups


def _digest(bundle: Bundle) -> bytes:
    digest = hashlib.sha256(bundle.scene.encode())
    for path, data in sorted(bundle.files.items()):
        digest.update(path.encode() + b"\0" + data)
    return digest.digest()
