"""`softseam check`: is the scene good, is its mesh good, and what will simulating it take? Simulates nothing."""

import math
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from softseam.checks import When, doubts, of_company
from softseam.choice import symmetric
from softseam.duration import expected_duration, too_many_steps
from softseam.embedded import describe
from softseam.errors import SceneRefused
from softseam.outputs import check_ending, check_outputs
from softseam.previewing import draw_preview
from softseam.scenes import bundle_of, bundle_with, inputs_of, located
from softseam.variants import with_settings
from softseam_protocol.scene.file import scene_hash
from softseam_protocol.scene.repeat import repeated
from softseam_protocol.scene.scene import Scene


def check_scene(name: str, settings: Sequence[str], console: Console, picture: Path | None = None) -> None:
    """Build the bodies and the tools as a run would, print what they are, and draw them to a .png where one is named.
    Raises SceneRefused and BadInput."""
    if picture is not None:
        check_ending("--picture", picture, ".png", "a picture")
        check_outputs([("--picture", picture)], inputs=inputs_of(name))
    loaded, bundle = bundle_of(name)
    scene = with_settings(loaded, settings)
    if scene is not loaded:
        bundle = bundle_with(scene, bundle, name, settings)
    if endless := too_many_steps(scene):
        raise SceneRefused(located(endless, name, settings))
    try:
        found = describe(bundle)
    except SceneRefused as error:
        raise SceneRefused(located(str(error), name, settings)) from None
    console.print(_grid({"scene": f"{scene.name}  (hash {scene_hash(bundle)[:12]})"}))
    said: set[str] = set()
    for body, described in found.items():
        one = scene if scene.one is not None else scene.model_copy(update={"many": {body: scene.bodies[body]}})
        group = repeated(body) if repeated(body) in scene.many else ""
        if group not in said:  # of copies the first
            copies = f", of {sum(repeated(each) == group for each in found)} copies" if group else ""
            if len(found) > 1:
                console.print(Text(f"\n{body}{copies}", style="bold"))
            own = {"symmetry": symmetric(scene), "steps": _steps(scene.of(body))}
            console.print(_grid({**described.facts, **own}))
        warned = doubts(one, {body: (described.size, described.doubts)})
        print_doubts(_fresh(warned, body, group, said), name, settings, console)
        for note in _fresh(doubts(one, {body: (described.size, described.notes)}, When.NOTE), body, group, said):
            console.print(Text(f"note: {note}", style="dim"))
        if group:
            said.add(group)
    print_doubts(of_company(scene), name, settings, console)
    for note in of_company(scene, When.NOTE):
        console.print(Text(f"note: {note}", style="dim"))
    if picture is not None:
        console.print(Text(f"picture: {draw_preview(bundle, picture)}"), soft_wrap=True)
    console.print(Text("the scene can be simulated", style="green"))


def print_doubts(doubts: Sequence[str], name: str, settings: Sequence[str], console: Console) -> None:
    """Warn of what is doubtful (see `checks`) in a scene of this name or path, with file, line and column."""
    for doubt in doubts:
        console.print(Text(f"warning: {located(doubt, name, settings)}", style="yellow"), soft_wrap=True)


def _fresh(texts: Sequence[str], body: str, group: str, said: set[str]) -> list[str]:
    """Sentences about a body; of copies those that were not said of another one."""
    if not group:
        return list(texts)
    about = [text.replace(f"bodies.{body}", f"bodies.{group}") for text in texts]
    fresh = [text for text in about if text not in said]
    said.update(fresh)
    return fresh


def _grid(facts: dict[str, str]) -> Table:
    """Those that say something, one a line."""
    table = Table.grid(padding=(0, 2))
    table.add_column(style="dim")
    for fact, text in facts.items():
        if text:
            table.add_row(fact, text)
    return table


def _steps(scene: Scene) -> str:
    duration = expected_duration(scene)
    if duration is None:
        return f"of {1e3 * scene.step:g} ms, until the motion ends"
    return f"{math.ceil(duration / scene.step - 1e-9)} of {1e3 * scene.step:g} ms: {duration:.3g} s"
