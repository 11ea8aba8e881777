"""Scene files: from a path to a validated Scene and the Bundle that carries it, or one SceneError that says where."""

import difflib
import hashlib
import json
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene import marked_yaml
from softseam_protocol.scene.keys import described, keys_allowed
from softseam_protocol.scene.marked_yaml import Mark, Marked
from softseam_protocol.scene.motion import PHASE_KEYS
from softseam_protocol.scene.repeat import repeated
from softseam_protocol.scene.scene import AS_WRITTEN, Scene
from softseam_protocol.scene.tools import MeshTool
from softseam_protocol.scene.whole_file import Unreadable, whole_file
from softseam_protocol.scene.written_number import remedy

MAX_SCENE_BYTES = 2**20


class SceneError(Exception):
    """What is wrong in a scene, and where: one error, one remedy.

    `allowed` lists what may stand there, `expected` says what it means, `nearest` is the likeliest correction.
    """

    def __init__(
        self,
        file: str,
        line: int,
        column: int,
        key: str,
        problem: str,
        allowed: str = "",
        nearest: str = "",
        expected: str = "",
    ) -> None:
        self.file, self.line, self.column, self.key, self.problem = file, line, column, key, problem
        self.allowed, self.nearest, self.expected = allowed, nearest, expected
        text = f"{file}:{line}:{column}: " + (f"{key}: " if key else "") + problem
        if nearest:
            text += f"; did you mean {nearest!r}?"
        if allowed:
            text += f" (allowed: {allowed})"
        if expected:
            text += f" (expected: {expected})"
        super().__init__(text)


@dataclass(frozen=True)
class LoadedScene:
    """A scene read from a file, ready to be sent."""

    scene: Scene
    bundle: Bundle
    path: Path
    text: str
    """the file as it was written"""


def load_scene(path: str | Path) -> LoadedScene:
    """Read and validate a scene file and the files it names. Raises SceneError."""
    path = Path(path)
    try:
        with path.open("rb") as file:
            raw = file.read(MAX_SCENE_BYTES + 1)
    except OSError as error:
        raise SceneError(str(path), 1, 1, "", f"cannot be read: {error.strerror}", _beside(path)) from None
    if len(raw) > MAX_SCENE_BYTES:
        raise SceneError(str(path), 1, 1, "", f"larger than {MAX_SCENE_BYTES} bytes: is this a scene file?")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise SceneError(str(path), line, 1, "", "not UTF-8 text: is this a scene file?") from None
    scene, marked = _parse(text, str(path))
    keys = {named: _written(key, marked.values) for key, named in reversed(files_of(scene))}
    files = {named: _read_mesh(path, key, named, marked.values[key]) for named, key in keys.items()}
    return LoadedScene(scene, Bundle(scene_json(scene), files), path, text)


def parse_scene(text: str, name: str = "<scene>") -> Scene:
    """Validate the text of a scene (YAML or JSON); errors call the file `name`. Raises SceneError."""
    return _parse(text, name)[0]


def scene_from_document(document: dict[str, Any], name: str) -> Scene:
    """Validate a scene that is read already, at a fraction of what `parse_scene` takes. Raises SceneError."""
    try:
        return Scene.model_validate_json(json.dumps(document, allow_nan=False), strict=True)
    except ValueError:  # a ValidationError, or a number that is not finite
        return parse_scene(json.dumps(document), name)


def place_of(path: Path, key: str) -> tuple[int, int]:
    """Line and column of a dotted key in a scene's file, or of what of it is there. Raises OSError and YamlError."""
    values = marked_yaml.parse(path.read_text("utf-8-sig")).values
    at = _written(tuple(int(item) if item.isdigit() else item for item in key.split(".")), values)
    while at not in values:
        at = at[:-1]
    return values[at].line, values[at].column


def _written(key: marked_yaml.Path, values: Collection[marked_yaml.Path]) -> marked_yaml.Path:
    """A key as a scene's file has it, whose keys are these: of a copy that of what is repeated."""
    if len(key) > 1 and key[0] == "bodies" and key[:2] not in values:
        return ("bodies", repeated(str(key[1])), *key[2:])
    return key


def scene_from_bundle(bundle: Bundle) -> Scene:
    """The scene of a bundle. Raises SceneError."""
    scene = _read(bundle.scene)
    for key, path in files_of(scene):
        if path not in bundle.files:
            raise SceneError("<bundle>", 1, 1, _dotted(key), f"the file {path!r} is not in the bundle")
    return scene


@lru_cache(maxsize=4)  # of many bodies, each is built from the same text
def _read(text: str) -> Scene:
    """The scene of a bundle's text, which nobody changes. Raises SceneError."""
    try:
        return Scene.model_validate_json(text, strict=True)
    except ValidationError:
        return parse_scene(text, "<bundle>")


def files_of(scene: Scene) -> list[tuple[marked_yaml.Path, str]]:
    """Files that a scene names: where it does so, and their paths as it gives them."""
    found: list[tuple[marked_yaml.Path, str]] = []
    for name, body in scene.bodies.items():
        at = ("body",) if scene.one is not None else ("bodies", name)
        found += [((*at, *key), path) for key, path in body.named_files]
    found += [(("tools", name, "path"), tool.path) for name, tool in scene.tools.items() if isinstance(tool, MeshTool)]
    return found


def files_from_here(scene: Scene) -> dict[str, bytes]:
    """Contents of the files that a scene made in code names, from the working folder on. Raises SceneError."""
    return {named: _read_mesh(Path("<scene>"), key, named, Mark(1, 1)) for key, named in files_of(scene)}


def bundle_scene(scene: Scene, files: dict[str, bytes] | None = None) -> Bundle:
    """The bundle of a scene made in code."""
    return Bundle(scene_json(scene), dict(files or {}))


def scene_json(scene: Scene) -> str:
    """The canonical text of a scene: every default written out, keys sorted."""
    return json.dumps(scene.model_dump(mode="json"), sort_keys=True, separators=(",", ":"))


def scene_as_written(scene: Scene) -> dict[str, Any]:
    """The document of a scene in which bodies that repeat are once: what settings change."""
    return scene.model_dump(mode="json", context=AS_WRITTEN)


def scene_hash(bundle: Bundle) -> str:
    """SHA-256 (hex) of a scene and its files; the same for every way of writing the same scene."""
    digest = hashlib.sha256(scene_json(scene_from_bundle(bundle)).encode())
    for name in sorted(bundle.files):
        content = bundle.files[name]
        digest.update(f"\0{name}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()


def scene_schema() -> str:
    """The published JSON Schema of scene files."""
    return json.dumps(Scene.model_json_schema(), indent=2, sort_keys=True) + "\n"


# ---- validation --------------------------------------------------------------------------------------------


def _parse(text: str, name: str) -> tuple[Scene, Marked]:
    try:
        marked = marked_yaml.parse(text)
    except marked_yaml.YamlError as error:
        raise SceneError(name, error.mark.line, error.mark.column, _dotted(error.path), str(error)) from None
    if not isinstance(marked.data, dict):
        mark = marked.values[()]
        raise SceneError(
            name, mark.line, mark.column, "", f"a scene is a mapping of keys, but this is {_called(marked.data)}"
        )
    bad = next((p for p, v in _walk(marked.data, ()) if isinstance(v, float) and not math.isfinite(v)), None)
    if bad is not None:
        mark = marked.values[bad]
        raise SceneError(name, mark.line, mark.column, _dotted(bad), "must be a finite number")
    try:
        # strict JSON: a list becomes a tuple and 1 a float, but "1" and true are not numbers
        return Scene.model_validate_json(json.dumps(marked.data), strict=True), marked
    except ValidationError as error:
        details = error.errors(include_url=False)
        # a misspelt key is also a missing one: speak of the misspelling
        missing = [d["type"] == "missing" for d in details]
        located = [_located(d, marked, name) for d in details]
        order = zip(missing, (e.line for e in located), (e.column for e in located), range(len(located)), strict=True)
        raise located[min(order)[-1]] from None


def _walk(data: Any, path: marked_yaml.Path) -> Any:
    yield path, data
    children = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in children:
        yield from _walk(value, (*path, key))


def _located(details: ErrorDetails, marked: Marked, name: str) -> SceneError:
    """One of pydantic's errors as a SceneError with its place in the file."""
    kind, context = details["type"], details.get("ctx", {})
    loc = (*details["loc"], *context.get("at", ()))
    path, missing = _real_path(loc, marked.data)
    found = _at(marked.data, path)
    mark, value_mark = marked.keys.get(path, marked.values[path]), marked.values[path]

    def error(problem: str, place: Mark = value_mark, key: marked_yaml.Path = path, **hints: str) -> SceneError:
        return SceneError(name, place.line, place.column, _dotted(key), problem, **hints)

    if kind == "extra_forbidden":
        keys = keys_allowed(loc[:-1])
        return error("unknown key", mark, allowed=", ".join(keys), nearest=_nearest(str(path[-1]), keys))
    if kind in ("missing", "too_long", "too_short") and isinstance(found, list):
        few = kind != "too_long"
        problem = f"a list of {len(found)} has too {'few' if few else 'many'} entries"
        meant = marked.close.get(path, [])
        if len(meant) == context.get("max_length"):
            commas = next(entry for entry in meant if "," in entry)
            problem += f': "{commas}" is {remedy(commas)}'
        return error(problem, expected=described(loc))
    if kind in ("missing", "union_tag_not_found"):
        key = "kind" if kind == "union_tag_not_found" else str(loc[-1])
        return error(f"the key {key!r} is missing", mark, (*path, key))
    if kind == "union_tag_invalid":
        at_tag = (*path, "kind")
        problem, allowed, nearest = _not_among(found["kind"], context["expected_tags"])
        return error(problem, marked.values[at_tag], at_tag, allowed=allowed, nearest=nearest)
    if kind == "literal_error":
        problem, allowed, nearest = _not_among(found, context["expected"])
        return error(problem, allowed=allowed, nearest=nearest)
    if kind == "phase":
        keys = [key for key in found if key not in PHASE_KEYS] if isinstance(found, dict) else []
        return error(details["msg"], mark, nearest=next(filter(None, (_nearest(k, PHASE_KEYS) for k in keys)), ""))
    if kind == "scene":
        have = context.get("have")
        if have is None:
            return error(details["msg"], value_mark if context.get("at") else mark)
        of_key, allowed = context.get("of_key"), ", ".join(have) or "the scene has no tools"
        nearest = _nearest(str(found if of_key is None else of_key), have)
        return error(details["msg"], value_mark if of_key is None else mark, allowed=allowed, nearest=nearest)
    if "[key]" in loc:
        return error(f"{path[-1]!r} is not a name: a letter, then letters, digits, _ and -", mark)
    if kind == "string_pattern_mismatch":
        return error(f"{found!r} is not a name: letters, digits, _ and -")
    problem = f"{_plain(details['msg'])}, but this is {_called(found)}"
    if kind in _OF_NUMBERS and isinstance(found, str) and (what := remedy(found)):
        problem += f", {what}"
    return error(problem, mark if missing else value_mark, expected=described(loc))


_OF_NUMBERS = ("float_type", "int_type")
"""pydantic's errors about what is no number"""


def _not_among(found: Any, options: str) -> tuple[str, str, str]:
    """Problem, allowed values and the nearest one, for a value that is none of pydantic's list of options."""
    names = [option.strip().strip("'") for option in options.replace(" or ", ", ").split(",")]
    nearest = _nearest(found, names) if isinstance(found, str) else ""
    return f"{_called(found)} is not known here", ", ".join(names), nearest


def _real_path(loc: tuple[str | int, ...], data: Any) -> tuple[marked_yaml.Path, bool]:
    """The part of an error's location that exists in the file; union tags are passed over."""
    path: list[str | int] = []
    missing = False
    for item in loc:
        if item == "[key]":
            continue
        if isinstance(data, dict) and item in data and isinstance(item, str):
            data = data[item]
        elif isinstance(data, list) and isinstance(item, int) and item < len(data):
            data = data[item]
        else:
            missing = True
            continue
        path.append(item)
        missing = False
    return tuple(path), missing


def _at(data: Any, path: marked_yaml.Path) -> Any:
    for item in path:
        data = data[item]
    return data


def _nearest(word: str, options: Sequence[str]) -> str:
    return next(iter(difflib.get_close_matches(word, options, 1, 0.6)), "")


def _called(value: Any) -> str:
    """How an error names what it found."""
    if value is None:
        return "empty"
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    return json.dumps(value)


def _plain(message: str) -> str:
    message = message.removeprefix("Input ").removeprefix("Value ")
    return message.replace("a valid tuple", "a list").replace("a valid array", "a list").replace("a valid ", "a ")


def _dotted(path: marked_yaml.Path) -> str:
    return ".".join(str(item) for item in path)


# ---- files -------------------------------------------------------------------------------------------------


def _beside(path: Path) -> str:
    """Files beside a missing one whose names are like it."""
    try:
        names = [p.name for p in path.parent.iterdir() if p.is_file()]
    except OSError:
        return ""
    return ", ".join(difflib.get_close_matches(path.name, names, 3, 0.5))


def _read_mesh(scene_path: Path, key: marked_yaml.Path, named: str, mark: Mark) -> bytes:
    """Content of the mesh file that a scene names at `key`, which stands at `mark`. Raises SceneError."""
    try:
        return whole_file(scene_path.parent / named)
    except Unreadable as error:
        where = (str(scene_path), mark.line, mark.column, _dotted(key))
        raise SceneError(*where, str(error), nearest="" if error.path.exists() else _beside(error.path)) from None
