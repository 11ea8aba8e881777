"""The same scene simulated otherwise: with one model alone, or with settings changed from the command line."""

import json
from collections.abc import Iterable, Sequence
from typing import Any

from softseam.errors import BadInput, SceneRefused, not_among
from softseam_protocol.models import MODELS, taking
from softseam_protocol.scene import marked_yaml
from softseam_protocol.scene.bodies import AnyBody, block_of
from softseam_protocol.scene.file import SceneError, scene_as_written, scene_from_document, scene_json
from softseam_protocol.scene.regions import RegionsSpec
from softseam_protocol.scene.scene import Scene

AS_GIVEN = ("budget=null", "tolerance=null")
"""settings with which a scene is simulated as it stands, whatever accuracy it asks for"""

Model = str
"""a row of MODELS, or HYBRID"""
HYBRID = "hybrid"


def models() -> tuple[Model, ...]:
    """What may be asked for in place of what a scene says, once extensions have added their models."""
    return (*MODELS, HYBRID)


def with_model(scene: Scene, model: Model) -> Scene:
    """The scene with FEM alone, PBD alone, or cut into both also where one would do.

    Hybrid is FEM where the scene's near region says so; of a scene that has none, in cells within half a cell of the
    tools that move, of all where none does. It is refused where there are no tools, or no cells whose size is known.

    Of several bodies each has the model alone, and hybrid is the model and the cells that are right for each block
    (docs/results/front.md), whatever the scene says of it; other shapes keep what it says.
    """
    if model not in models():
        raise BadInput(f"no model is called {model!r}; there are: {', '.join(models())}")
    if len(scene.bodies) > 1:
        return _each_with(scene, model)
    moving, body = taking("particles"), scene.body
    if model not in moving and not body.has_cells:
        raise BadInput(
            f"the scene {scene.name!r} has a {body.kind}, which is made of particles: only "
            f"{' and '.join(moving)} moves it"
        )
    if model == HYBRID:
        if not scene.regions.hybrid:
            return _cut_near_tools(scene, body)
        return scene.model_copy(update={"regions": scene.regions.always_cut})
    symmetry = scene.symmetry if MODELS[model].one_side else ()
    return scene.model_copy(update={"regions": RegionsSpec(default=model), "symmetry": symmetry})


def _each_with(scene: Scene, model: Model) -> Scene:
    """Of several bodies."""
    moving, settings = taking("particles"), []
    for name, body in scene.many.items():
        key, block = f"bodies.{name}", block_of(body)
        if model == HYBRID:
            settings += [] if block is None else [f"{key}.regions={{}}"]
            settings += [] if block is None or block.shape.graded else [f"{key}.cell=null"]
        elif body.has_cells or (model in moving and body.usual_model != model):
            settings.append(f"{key}.regions={{default: {model}}}")
        elif model not in moving:
            raise BadInput(
                f"the scene {scene.name!r} has {name!r}, a {body.kind}, which is made of particles: only "
                f"{' and '.join(moving)} moves it; say regions.default of the others, "
                f"e.g. --set bodies.NAME.regions={{default: {model}}}"
            )
    try:
        return changed(scene, settings)
    except SceneError as error:
        raise BadInput(f"the scene {scene.name!r} cannot have --model {model}: {refusal(error)}") from None


def _cut_near_tools(scene: Scene, body: AnyBody) -> Scene:
    """FEM within half a cell of tools, PBD elsewhere."""
    edge = _longest_edge(body)
    if edge is None or not scene.tools:
        what = "its cells' size, which only its file has, is not known here" if scene.tools else "it has no tools"
        raise BadInput(
            f"the scene {scene.name!r} has no near region with a model of its own, and {what}: add one to it, "
            "e.g. regions: {default: pbd, near: {model: fem, within: 0.012}}"
        )
    which = "" if scene.motion else f", tools: {json.dumps(list(scene.tools))}"
    near = f"{{model: fem, within: {0.5 * edge:.6g}, split: always{which}}}"
    try:
        return changed(scene, ["regions.default=pbd", f"regions.near={near}"])
    except SceneError as error:
        raise BadInput(f"the scene {scene.name!r} cannot be cut into FEM and PBD: {refusal(error)}") from None


def _longest_edge(body: AnyBody) -> float | None:
    """Of its cells [m]; of a block that names none they are a third of its least extent at most."""
    if body.wanted_edges:
        return max(body.wanted_edges)
    block = block_of(body)
    return None if block is None else min(block.shape.size) / 3.0


def with_settings(scene: Scene, settings: Iterable[str]) -> Scene:
    """The scene with `key.key=value` applied in turn, values read as YAML; validated as a whole.

    Keys walk through mappings by name and through lists by index: `motion.1.close=0.01`, `tools.left.friction=0.05`.
    Of a body that repeats they mean all copies, or one: `bodies.cube.cell=0.01`, `bodies.cube_0_0_0.cell=0.01`.
    """
    settings = list(settings)
    try:
        return changed(scene, settings)
    except SceneError as error:
        about = [setting for setting in settings if _touches(setting.partition("=")[0].strip(), error.key)]
        named = " ".join(f"--set {setting}" for setting in about or settings)
        raise SceneRefused(f"{named}: {refusal(error)}") from None


def changed(scene: Scene, settings: Sequence[str]) -> Scene:
    """As `with_settings`, which says what to change on the command line. Raises BadInput, and SceneError."""
    if not settings:
        return scene
    named = {keys[1] for keys in (setting.split(".", 2) for setting in settings) if keys[0] == "bodies" and keys[1:]}
    copies = named & (scene.bodies.keys() - scene.many.keys())  # who means one of them means each
    document = json.loads(scene_json(scene)) if copies else scene_as_written(scene)
    for setting in settings:
        path, equals, text = setting.partition("=")
        keys = [key.strip() for key in path.split(".")]
        if not equals or not all(keys):
            raise BadInput(f"--set {setting}: write it as key=value, e.g. --set tools.left.friction=0.05")
        try:
            value = marked_yaml.parse(text).data
        except marked_yaml.YamlError:
            raise BadInput(f"--set {setting}: the value is not YAML: {text!r}") from None
        if keys[-1] == "path":
            _forget_unit(document, keys[:-1])
        _assign(document, keys, value, setting)
    return scene_from_document(document, "--set")


def refusal(error: SceneError) -> str:
    """What is wrong with which key of a scene, without the place in a file."""
    hint = f"; did you mean {error.nearest!r}?" if error.nearest else ""
    allowed = f" (allowed: {error.allowed})" if error.allowed else ""
    return f"{error.key}: {error.problem}{hint}{allowed}"


def _forget_unit(document: dict[str, Any], keys: Sequence[str]) -> None:
    """Leave out scale and upward axis of the file at `keys` in place, where they are what they are without being given:
    those of another file may be others."""
    node: Any = document
    for key in keys:
        node = node.get(key, {}) if isinstance(node, dict) else {}
    for key, usual in (("scale", 1.0), ("up", "z")):
        if node.get(key) == usual:
            del node[key]


def _touches(path: str, key: str) -> bool:
    """Whether a setting of `path` changes what a key of the scene says: one of them is within the other."""
    return f"{path}.".startswith(f"{key}.") or f"{key}.".startswith(f"{path}.")


def _assign(document: dict[str, Any], keys: list[str], value: Any, setting: str) -> None:
    """Set document[keys[0]][keys[1]]... in place; an empty optional part, such as `regions.near`, begins anew."""
    node: Any = document
    for depth, key in enumerate(keys):
        last = depth == len(keys) - 1
        where = ".".join(keys[:depth]) or "the scene"
        if isinstance(node, dict):
            if last:
                node[key] = value
            elif key in node:
                node[key] = {} if node[key] is None else node[key]
            else:
                raise BadInput(f"--set {setting}: {where} has no {not_among(key, node)}")
            node = node[key]
        elif isinstance(node, list) and key.isdigit() and int(key) < len(node):
            if last:
                node[int(key)] = value
            node = node[int(key)]
        else:
            what = f"a list of {len(node)}" if isinstance(node, list) else repr(node)
            raise BadInput(f"--set {setting}: {where} is {what} and has no {key!r}")
