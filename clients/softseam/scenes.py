"""Scenes to open: files, the ones that come with softseam, and scenes made in code."""

import difflib
import re
from collections.abc import Sequence
from pathlib import Path

from softseam.errors import SceneRefused
from softseam.variants import with_settings
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.scene.file import (
    SceneError,
    bundle_scene,
    files_from_here,
    files_of,
    place_of,
    scene_from_bundle,
)
from softseam_protocol.scene.file import load_scene as _load
from softseam_protocol.scene.keys import fields_of
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.whole_file import Unreadable, whole_file

_NAMED = re.compile(rf"(?:^|: )((?:{'|'.join(fields_of(Scene))})(?:\.[\w-]+)*): ")
Source = str | Path | Scene | Bundle
"""a file or the name of a scene that comes with softseam, a scene made in code, one that came with its files"""
_CHECKOUT = Path(__file__).parents[2] / "scenes"
_INSTALLED = Path(__file__).parents[1] / "softseam_scenes"


def scene_names() -> list[str]:
    """Names of the scenes that come with softseam."""
    return sorted(path.stem for path in _folder().glob("*.yaml"))


def scene_path(name: str | Path) -> Path:
    """The file that a user means: a path, or the name of a scene that comes with softseam. Raises SceneRefused."""
    path = Path(name)
    if path.is_file():
        return path
    bundled = _folder() / f"{name}.yaml"
    plain = not path.suffix and len(path.parts) == 1
    if plain and bundled.is_file():
        return bundled
    names = scene_names()
    if path.is_dir():
        raise SceneRefused(
            f"{str(name)!r} is a folder: name a scene file, e.g. {path / 'scene.yaml'}, or a scene that comes with "
            f"softseam ({', '.join(names)})"
        )
    if not plain:
        return path
    near = difflib.get_close_matches(str(name), names, 1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise SceneRefused(
        f"no file is called {str(name)!r}, and no scene that comes with softseam{hint} (there are: {', '.join(names)})"
    )


def references_folder() -> Path:
    """Where the references lie that come with softseam, one for a scene."""
    return _folder() / "references"


def load_scene(name: str | Path | Scene) -> Scene:
    """Read and validate a scene file, or a scene that comes with softseam. Raises SceneRefused."""
    return bundle_of(name)[0]


def bundle_of(scene: Source) -> tuple[Scene, Bundle]:
    """A scene and what a participant needs to simulate it. Raises SceneRefused.

    Paths of meshes are those from the scene's file, or, of a scene made in code, from the working folder.
    """
    try:
        if isinstance(scene, Bundle):
            return scene_from_bundle(scene), scene
        if isinstance(scene, Scene):
            return scene, bundle_scene(scene, files_from_here(scene))
        loaded = _load(scene_path(scene))
    except SceneError as error:
        raise SceneRefused(str(error)) from None
    return loaded.scene, loaded.bundle


def bundle_with(scene: Scene, bundle: Bundle, source: Source, settings: Sequence[str] = ()) -> Bundle:
    """The bundle of a scene that settings made of a source, with the files that it names now. Raises SceneRefused.

    Files that the source does not name are read from beside its file, else from the working folder.
    """
    files = {
        named: bundle.files.get(named) or _file(_dotted(at), named, source, settings) for at, named in files_of(scene)
    }
    return bundle_scene(scene, files)


def _file(key: str, named: str, source: Source, settings: Sequence[str]) -> bytes:
    """Content of a file that a setting names at a key. Raises SceneRefused."""
    beside = Path() if isinstance(source, Scene | Bundle) else scene_path(source).parent
    places = list(dict.fromkeys([beside / named, Path(named)]))
    try:
        return whole_file(next((place for place in places if place.exists()), places[0]))
    except Unreadable as error:
        others = "".join(f", nor is there {place}" for place in places[1:])
        raise SceneRefused(located(f"{key}: {error}{others}", source, settings)) from None


def inputs_of(scene: Source) -> dict[str, Path]:
    """Files that a scene is read from, by what they are: itself, and those that it names. Raises SceneRefused."""
    if isinstance(scene, Bundle):
        return {}
    itself = {} if isinstance(scene, Scene) else {"the scene itself": scene_path(scene)}
    folder = next((path.parent for path in itself.values()), Path())
    return itself | {f"the scene's {_dotted(at)}": folder / name for at, name in files_of(load_scene(scene))}


def located(text: str, scene: Source, settings: Sequence[str] = ()) -> str:
    """A refusal, from the key on that it names, and where that stands: in a setting, or in file, line and column.

    Whoever builds a body or a solver knows the scene, not the file that it was read from.
    """
    found = _NAMED.search(text)
    if found is not None:
        key, text = found[1], text[found.start(1) :]
    elif isinstance(scene, Scene | Bundle):
        return text
    else:
        # what is wrong in a mesh begins with its file
        files = files_of(with_settings(load_scene(scene), settings))
        named = [_dotted(at) for at, path in files if text.startswith(f"{path}:")]
        if not named:
            return text
        key, text = named[0], f"{named[0]}: {text}"
    for setting in reversed(settings):
        given = setting.partition("=")[0].strip()
        # the key itself, one that it lies in, or one of those that it stands for
        if f"{key}.".startswith(f"{given}.") or given.startswith(f"{key}."):
            return f"--set {setting}: {text}"
    if isinstance(scene, Scene | Bundle):
        return text
    path = scene_path(scene)
    line, column = place_of(path, key)
    return f"{path}:{line}:{column}: {text}"


def _dotted(key: Sequence[str | int]) -> str:
    return ".".join(map(str, key))


def _folder() -> Path:
    return _CHECKOUT if (_CHECKOUT / "tofu_grasp.yaml").is_file() else _INSTALLED
