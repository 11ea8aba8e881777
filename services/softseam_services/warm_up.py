"""Compiles (or loads from numba's cache) what a service will run, before anybody waits for it.

A small body between tools goes through every request that a participant answers. What reads a mesh as a tool is
compiled with the first scene that has one, before its first step, or ahead of time where asked for.
"""

from __future__ import annotations

import contextlib
import gc
import os
import subprocess
import sys
from collections.abc import Iterable
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numba import config

from softseam_protocol.messages import participant as messages
from softseam_protocol.messages.header import SCHEMA_VERSION, Header
from softseam_protocol.messages.names import ONLY_BODY
from softseam_protocol.models import FAR_DEFAULT, MODELS
from softseam_protocol.scene.interfaces import ContactSpec
from softseam_protocol.scene.regions import RegionsSpec
from softseam_protocol.scene.scene import Scene
from softseam_services.kernel_cache import compiling
from softseam_services.server import ParticipantServer, build_setup
from softseam_services.solvers import SOLVERS
from softseam_services.tools.motion import tool_motion

SESSION = "warm-up"
WEDGE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
"""a tetrahedron, as an OBJ file"""


class WarmUpFailed(RuntimeError):
    """A model cannot take its first step on this machine."""


def warm_scene(model: str, mesh: bool = False) -> Scene:
    """A block of two cells on a plane under a ball, a plate at its side, split into two of `model`; mesh: and a wedge.

    The wedge is WEDGE, as the file wedge.obj.
    """
    wedge = {"wedge": {"kind": "mesh", "path": "wedge.obj", "scale": 0.01, "position": [0.1, 0.0, 0.0]}}
    return Scene.model_validate(
        {
            "softseam": 1,
            "name": "warm-up",
            "duration": 0.05,
            "step": 0.005,
            "body": {
                "shape": {"kind": "block", "size": [0.04, 0.02, 0.02]},
                "cell": 0.02,
                "material": {"kind": "neo_hookean", "young": 2.0e4, "poisson": 0.45, "density": 1050.0},
            },
            "tools": {
                "ground": {"kind": "plane", "friction": 0.5},
                "plate": {"kind": "box", "size": [0.01, 0.04, 0.04], "position": [-0.025, 0.0, 0.02], "friction": 0.6},
                "ball": {"kind": "sphere", "radius": 0.01, "position": [0.01, 0.0, 0.0301], "friction": 0.6},
                **(wedge if mesh else {}),
            },
            "motion": [{"tools": ["ball"], "move": [0.0, 0.0, -0.001], "speed": 0.02}],
            "regions": {
                "default": model,
                "near": {"model": model, "boxes": [{"min": [-0.03, -0.02, 0.0], "max": [0.0, 0.02, 0.03]}]},
            },
        }
    )


def warm_participant(model: str, mesh: bool = False) -> None:
    """Let a participant of `model` answer every kind of request; mesh: of a mesh as a tool too. Raises WarmUpFailed.

    Does nothing for a model without kernels.
    """
    if not SOLVERS[model].kernels:
        return
    with compiling(model):
        _ask_everything(model, mesh)
        if MODELS[model].one_side:
            _solve_whole(model, ("x",))


def _asked(server: ParticipantServer, request: messages.Request) -> object:
    reply = server.handle(request)
    if isinstance(reply, messages.Failure):
        raise WarmUpFailed(f"{type(request).__name__}: {reply.message}")
    return reply


def _header(step: int, exchange: int = 0) -> Header:
    return Header(SCHEMA_VERSION, SESSION, "near", 0, step, exchange, 0.005 * step)


def warm_whole(model: str) -> None:
    """Let a participant of `model` take a step of a whole body: what a first step needs, and no more."""
    with compiling(model):
        _solve_whole(model)


def _solve_whole(model: str, symmetry: tuple[str, ...] = ()) -> None:
    """A step of the same block on the ground, all of `model`."""
    scene = warm_scene(model)
    ground = {
        "tools": {"ground": scene.tools["ground"]},
        "motion": (),
        "regions": RegionsSpec(default=model),
        "symmetry": symmetry,
    }
    bundle = messages.Bundle(scene.model_copy(update=ground).model_dump_json(), {})
    setup = build_setup(bundle)
    server = ParticipantServer()
    server.adopt(bundle, {ONLY_BODY: setup})
    _asked(
        server,
        messages.Configure(_header(0), bundle, model, np.array([0, 1], dtype=np.int32), np.zeros(0, dtype=np.int32)),
    )
    tools = setup.tools
    motion = tool_motion(tools.position, tools.orientation, np.zeros((1, 6)), scene.step)
    _asked(server, messages.Advance(_header(0), scene.step, np.zeros((0, 3)), motion, False))
    _asked(server, messages.Observe(_header(0)))
    _asked(server, messages.Release(_header(0)))


def _ask_everything(model: str, mesh: bool) -> None:
    bundle = messages.Bundle(warm_scene(model, mesh).model_dump_json(), {"wedge.obj": WEDGE} if mesh else {})
    setup = build_setup(bundle)
    server = ParticipantServer()
    server.adopt(bundle, {ONLY_BODY: setup})
    ask, header = partial(_asked, server), _header
    tools, scene = setup.tools, setup.scene
    assert setup.body.has_cells
    shared = np.intersect1d(setup.body.cell_nodes[0], setup.body.cell_nodes[1]).astype(np.int32)
    configured = ask(messages.Configure(header(0), bundle, model, np.array([0], dtype=np.int32), shared))
    assert isinstance(configured, messages.Configured)
    command = np.zeros((len(tools.names), 6))
    command[tools.names.index("ball"), 2:4] = -0.02, 0.1
    position, orientation = tools.position.copy(), tools.orientation.copy()
    for step in range(2):
        motion = tool_motion(position, orientation, command, scene.step)
        for exchange in range(2):
            force = np.full((len(shared), 3), 1e-4 * exchange)
            ask(messages.Advance(header(step, exchange), scene.step, force, motion, exchange == 0))
        if configured.capabilities is not None and configured.capabilities.impedance:
            anchor, stiffness = setup.body.x_rest[shared], np.eye(3 * len(shared))
            ask(messages.Advance(header(step, 2), scene.step, force, motion, False, anchor, stiffness))
        ask(messages.Correct(header(step, 3), force, force))
        position = motion.position_next
        ask(messages.Observe(header(step), indicators=step == 1, own=True))
    ask(messages.Commit(header(2)))
    taken = ask(messages.Snapshot(header(2)))
    assert isinstance(taken, messages.SnapshotTaken)
    ask(messages.Restore(header(2), taken.state))
    ask(messages.Release(header(2)))


def warm_pile(model: str, touching: bool = False) -> None:
    """Let a participant of `model` take a step of two bodies that are one part; touching: and in contact. Raises
    WarmUpFailed.

    Does nothing for a model that does not pile.
    """
    if not (MODELS[model].piles and SOLVERS[model].kernels):
        return
    block = warm_scene(model).body.model_copy(update={"regions": RegionsSpec(default=model)})
    names = ["first", "second"]
    contact = {"touch": ContactSpec(between=("first", "second"))} if touching else {}
    upper = block.model_copy(update={"position": (0.0, 0.0, 0.02)})
    bodies = {"many": {"first": block, "second": upper}, "one": None}
    beside = {name: tool for name, tool in warm_scene(model).tools.items() if name != "ball"}
    update = {**bodies, "tools": beside, "motion": (), "regions": RegionsSpec(), "joints": contact}
    scene = warm_scene(model).model_copy(update=update)
    with compiling(model):
        bundle, none = messages.Bundle(scene.model_dump_json(), {}), np.zeros(0, dtype=np.int32)
        setups = {name: build_setup(bundle, name) for name in names}
        server, tools = ParticipantServer(), setups["first"].tools
        server.adopt(bundle, setups)
        _asked(server, messages.Configure(_header(0), bundle, model, none, none, bodies=names))
        motion = tool_motion(tools.position, tools.orientation, np.zeros((len(tools.names), 6)), scene.step)
        _asked(server, messages.Advance(_header(0), scene.step, np.zeros((0, 3)), motion))
        _asked(server, messages.Release(_header(0)))


def never_compiled(model: str, module: str = "*") -> bool:
    """Whether kernels of `model`, all or those of one module, are nowhere beside their sources, but could be."""
    if model not in SOLVERS or not SOLVERS[model].kernels:
        return False
    spec = find_spec(SOLVERS[model].kernels)
    assert spec is not None and spec.origin is not None
    folder = Path(spec.origin).parent
    settings = vars(config)
    if settings["DISABLE_JIT"] or settings["CACHE_DIR"] or not os.access(folder, os.W_OK):
        return False
    return next((folder / "__pycache__").glob(f"{module}.*.nbi"), None) is None


class Beside:
    """Compiles kernels of models in processes of their own, while this one does something else.

    A context: what still runs at its end is stopped. What fails there is compiled here when needed, as is what was
    compiled on this machine before, in part: that may be little.
    """

    def __init__(self) -> None:
        self._fresh = {model for model in SOLVERS if never_compiled(model)}
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def begin(self, models: Iterable[str], *options: str) -> set[str]:
        """Begin those that nobody has compiled on this machine; which these are. options: of the command `warm`."""
        begun = self._fresh & {*models}
        command, quiet = [sys.executable, "-m", "softseam_services", "warm", *options], subprocess.DEVNULL
        for model in sorted(begun):
            self._processes[model] = subprocess.Popen([*command, model], stdin=quiet, stdout=quiet, stderr=quiet)
        self._fresh -= begun
        return begun

    def wait(self, models: Iterable[str]) -> None:
        """Until these are compiled; the others are stopped."""
        for model in self._processes.keys() - {*models}:
            self._processes.pop(model).kill()
        for process in self._processes.values():
            process.wait()

    def __enter__(self) -> Beside:
        return self

    def __exit__(self, *error: object) -> None:
        for process in self._processes.values():
            process.kill()  # which is nothing to one that has ended


def load_kernels(model: str, like: Scene | None = None) -> None:
    """Take a step of a small body by `model`: what a step needs is read from numba's cache then, or compiled, some
    tenths of a second that the first step of a simulation would wait for. Does nothing for a model without kernels, or
    where it was done in this process.

    like: the small body is of this scene's material, and its models have the same settings
    """
    if model not in SOLVERS or not SOLVERS[model].kernels:
        return
    small = warm_scene(model)
    small = small.model_copy(update={"regions": RegionsSpec.model_validate({"default": model})})
    loaded = [model]
    material = None if like is None else getattr(like.body, "material", None)
    if like is not None and material is not None:
        loaded += [material.kind, like.models.model_dump_json()]
        body = small.body.model_copy(update={"material": material})
        small = small.model_copy(update={"body": body, "models": like.models})
    if tuple(loaded) not in _loaded:
        _loaded.add(tuple(loaded))
        with contextlib.suppress(Exception):  # what a small body cannot have is loaded by the first step itself
            _take_steps(small, steps=1)


_loaded: set[tuple[str, ...]] = set()
"""models of which kernels were loaded in this process, with kinds of materials and settings"""


def settle() -> None:
    """Keep the collector of garbage away from what was loaded: it would search it again and again, for ms each time."""
    gc.collect()
    gc.freeze()


def warm_orchestrator() -> None:
    """Run a few coupled steps in this process: coupling, regions, hand-over and read-out."""
    with compiling(FAR_DEFAULT):
        _take_steps(warm_scene(FAR_DEFAULT))


def warm_particles() -> None:
    """Run a few steps of a sheet above a plane: what moves it moves ropes and meshes of tetrahedra, too."""
    sheet = {"kind": "sheet", "size": [0.04, 0.04], "divisions": [4, 4], "density": 0.2, "stretch": 100.0}
    scene = {"softseam": 1, "name": SESSION, "duration": 0.05, "step": 0.005, "body": sheet}
    ground = {"ground": {"kind": "plane", "point": [0.0, 0.0, -0.01], "friction": 0.5}}
    with compiling("particles"):
        _take_steps(Scene.model_validate(scene | {"tools": ground}))


def _take_steps(scene: Scene, steps: int = 3) -> None:
    """All that an orchestrator does with a simulation, in this process."""
    from softseam_services.orchestrator.embedded import EmbeddedTransport
    from softseam_services.orchestrator.simulation import Simulation

    bundle = messages.Bundle(scene.model_dump_json(), {})
    simulation = Simulation(bundle, EmbeddedTransport(), session=SESSION, emit=lambda message: None)
    for _ in range(steps):
        simulation.step(None, fields=True)
    simulation.load(simulation.save())
    simulation.close()
