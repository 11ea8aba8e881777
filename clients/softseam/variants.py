"""The same scene simulated otherwise: with one model alone, or with settings changed from the command line."""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterable
from typing import Any, Literal, get_args

from softseam.errors import BadInput, SceneRefused
from softseam_protocol.scene import marked_yaml
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.file import SceneError, scene_from_document, scene_json
from softseam_protocol.scene.regions import RegionsSpec
from softseam_protocol.scene.scene import Scene

AS_GIVEN = ("budget=null", "tolerance=null")
"""settings with which a scene is simulated as it stands, whatever accuracy it asks for"""

Model = Literal["fem", "pbd", "hybrid"]


def with_model(scene: Scene, model: Model) -> Scene:
    """The scene with FEM alone, PBD alone, or cut into both also where one would do.

    Hybrid is refused where the scene has no near region.
    """
    if model not in get_args(Model):
        raise BadInput(f"no model is called {model!r}; there are: {', '.join(get_args(Model))}")
    if len(scene.bodies) > 1:
        raise BadInput(
            f"the scene {scene.name!r} has several bodies, each with its own model: say regions.default of each, "
            f"e.g. --set bodies.{next(iter(scene.bodies))}.regions={{default: fem}}"
        )
    if model != "pbd" and not isinstance(scene.body, BodySpec):
        raise BadInput(
            f"the scene {scene.name!r} has a {scene.body.kind}, which is made of particles: only pbd moves it"
        )
    if model == "hybrid":
        near = scene.regions.near
        if near is None or near.model == scene.regions.default:
            raise BadInput(
                f"the scene {scene.name!r} has no near region with a model of its own: add one to it, "
                "e.g. regions: {default: pbd, near: {model: fem, within: 0.012}}"
            )
        always = near.model_copy(update={"split": "always"})
        return scene.model_copy(update={"regions": scene.regions.model_copy(update={"near": always})})
    symmetry = scene.symmetry if model == "fem" else ()  # only FEM solves for one side
    return scene.model_copy(update={"regions": RegionsSpec(default=model), "symmetry": symmetry})


def with_settings(scene: Scene, settings: Iterable[str]) -> Scene:
    """The scene with `key.key=value` applied in turn, values read as YAML; validated as a whole.

    Keys walk through mappings by name and through lists by index: `motion.1.close=0.01`, `tools.left.friction=0.05`.
    """
    settings = list(settings)
    if not settings:
        return scene
    document = json.loads(scene_json(scene))
    for setting in settings:
        path, equals, text = setting.partition("=")
        keys = [key.strip() for key in path.split(".")]
        if not equals or not all(keys):
            raise BadInput(f"--set {setting}: write it as key=value, e.g. --set tools.left.friction=0.05")
        try:
            value = marked_yaml.parse(text).data
        except marked_yaml.YamlError:
            raise BadInput(f"--set {setting}: the value is not YAML: {text!r}") from None
        _assign(document, keys, value, setting)
    try:
        return scene_from_document(document, "--set")
    except SceneError as error:
        hint = f"; did you mean {error.nearest!r}?" if error.nearest else ""
        allowed = f" (allowed: {error.allowed})" if error.allowed else ""
        about = [setting for setting in settings if _touches(setting.partition("=")[0].strip(), error.key)]
        changed = " ".join(f"--set {setting}" for setting in about or settings)
        raise SceneRefused(f"{changed}: {error.key}: {error.problem}{hint}{allowed}") from None


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
                near = difflib.get_close_matches(key, node, 1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                raise BadInput(
                    f"--set {setting}: {where} has no {key!r}{hint} (there are: {', '.join(node) or 'none'})"
                )
            node = node[key]
        elif isinstance(node, list) and key.isdigit() and int(key) < len(node):
            if last:
                node[int(key)] = value
            node = node[int(key)]
        else:
            what = f"a list of {len(node)}" if isinstance(node, list) else repr(node)
            raise BadInput(f"--set {setting}: {where} is {what} and has no {key!r}")
