"""`softseam fit`: numbers of a scene from measured forces, how sure they are, and the scene that has them."""

import json
from pathlib import Path

import numpy as np
import yaml
from rich.console import Console
from rich.table import Table
from rich.text import Text

from softseam.differentiating import forces_with_slopes
from softseam.embedded import EmbeddedBackend, tell_of_derivatives, translated
from softseam.errors import BadInput
from softseam.outputs import check_ending, check_outputs, write_whole
from softseam.scenes import bundle_of, bundle_with, inputs_of
from softseam.variants import AS_GIVEN, with_model, with_settings
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.models import REFERENCE
from softseam_protocol.scene.file import bundle_scene, scene_json
from softseam_protocol.scene.scene import Scene
from softseam_studies.cli_fitting import Fit
from softseam_studies.fit.branches import Branches
from softseam_studies.fit.curve import Curve, check_times, read_curve, read_off
from softseam_studies.fit.laboratory import fit_material
from softseam_studies.fit.least_squares import Answer, Floats, fit
from softseam_studies.fit.numbers import Number, numbers_of


def fit_curve(wishes: Fit, console: Console) -> Answer | Branches:
    """Fit, print, and write what is asked for. Raises BadInput, SceneRefused and SimulationFailed."""
    if wishes.curve is not None:
        if wishes.picture is not None:
            raise BadInput("--picture: only the fit of a material, without a scene, is drawn")
        return fit_scene(wishes, console)
    if not wishes.scene.endswith(".csv"):
        raise BadInput(f"softseam fit {wishes.scene}: say what was measured, a .csv file, after the scene")
    if wishes != Fit(wishes.scene, picture=wishes.picture):
        raise BadInput(
            f"{wishes.scene} is of a material: --find, --out, --runs and --set are of a scene, which stands before it"
        )
    return fit_material(Path(wishes.scene), wishes.picture, console)


def fit_scene(wishes: Fit, console: Console) -> Answer:
    """A scene's numbers, of its tools' forces. Raises BadInput, SceneRefused and SimulationFailed."""
    assert wishes.curve is not None
    path = wishes.curve
    if wishes.runs < 2:
        raise BadInput(f"--runs {wishes.runs}: at least 2, one to begin with and one to try")
    given, bundle = bundle_of(wishes.scene)
    if wishes.out is not None:
        check_ending("--out", wishes.out, ".yaml", "a scene")
        check_outputs([("--out", wishes.out)], inputs={**inputs_of(wishes.scene), "the curve": path})
    if len(given.bodies) > 1:
        raise BadInput(f"the scene {given.name!r} has several bodies, and a curve is fitted to one: fit it alone")
    scene = with_model(with_settings(given, (*wishes.settings, *AS_GIVEN)), REFERENCE)
    bundle = bundle_with(scene, bundle, wishes.scene, wishes.settings)
    numbers = numbers_of(scene, wishes.find)
    curve = read_curve(path, list(scene.tools))
    if curve.force.size <= len(numbers):
        raise BadInput(f"{path}: {curve.force.size} forces do not determine {len(numbers)} numbers and their errors")
    console.print(Text("the first fit on a machine compiles for half a minute", style="dim"))
    answer = _Model(scene, bundle, curve, path, numbers, console).fit(wishes.runs)
    _print(console, numbers, answer)
    if wishes.out is not None:
        _write(
            wishes.scene,
            path,
            wishes.out,
            with_settings(given, [*wishes.settings, *_settings(numbers, answer.values)]),
            numbers,
            answer,
        )
        console.print(Text(f"fitted scene: {wishes.out}"))
    return answer


class _Model:
    """A scene as a function of its numbers: forces at the curve's times, and their derivatives. Tells of each run."""

    def __init__(
        self, scene: Scene, bundle: Bundle, curve: Curve, path: Path, numbers: list[Number], console: Console
    ) -> None:
        self._scene, self._files, self._curve, self._path, self._numbers = scene, bundle.files, curve, path, numbers
        self._console, self._runs = console, 0
        self._backend: EmbeddedBackend | None = None

    def fit(self, most: int) -> Answer:
        start, low, high = (np.array([getattr(n, key) for n in self._numbers]) for key in ("start", "low", "high"))
        names = [number.name for number in self._numbers]
        try:
            return fit(self._forces, self._curve.force.ravel(), start, low, high, names, most)
        finally:
            if self._backend is not None:
                self._backend.close()

    def _forces(self, values: Floats) -> tuple[Floats, Floats]:
        varied = with_settings(self._scene, _settings(self._numbers, values))
        bundle = bundle_scene(varied, self._files)
        if self._backend is None:
            self._backend = EmbeddedBackend(bundle)
            tell_of_derivatives()
        else:
            self._backend.reset(varied.seed, bundle)
        with translated():
            run, slopes = forces_with_slopes(self._backend.simulation, [number.direction for number in self._numbers])
        check_times(self._curve, self._path, float(run.time[-1]), varied.step)
        forces, by_number = read_off(self._curve, run, slopes)
        self._runs += 1
        tried = ", ".join(
            f"{n.name} {value:.5g} {n.unit}".rstrip() for n, value in zip(self._numbers, values, strict=True)
        )
        off = float(np.sqrt(np.mean((forces - self._curve.force.ravel()) ** 2)))
        self._console.print(Text(f"run {self._runs}: {tried}: {off:.3g} N off", style="dim"))
        return forces, by_number


def _settings(numbers: list[Number], values: Floats) -> list[str]:
    return [one for number, value in zip(numbers, values, strict=True) for one in number.settings(float(value))]


def _told(number: Number, value: float, error: float, answer: Answer, place: int) -> str:
    if place in answer.untold:
        return f"cannot be determined: {answer.untold[place]}"
    if place in answer.at_bound:
        return "at a bound: begin nearer, or doubt the scene"
    if error > 0.5 * value:
        return "hardly determined: the error is as large as the number"
    return ""


def _print(console: Console, numbers: list[Number], answer: Answer) -> None:
    table = Table(title=f"fitted in {answer.runs} runs, {answer.residual:.3g} N off (rms)", title_justify="left")
    for name in ("", "begun at", "found", "± standard error", ""):
        table.add_column(name, justify="right" if name else "left")
    for place, number in enumerate(numbers):
        value, error = float(answer.values[place]), float(answer.errors[place])
        found = "" if place in answer.untold else f"{value:.5g}"
        sure = "" if np.isnan(error) else f"{error:.2g} {number.unit}"
        table.add_row(
            number.name, f"{number.start:.5g} {number.unit}", found, sure, _told(number, value, error, answer, place)
        )
    console.print(table)
    if not answer.settled:
        console.print(Text("not settled: allow more with --runs, or begin nearer with --set", style="yellow"))
    for place, number in enumerate(numbers):
        if place not in answer.untold:
            console.print(
                Text("  " + " ".join(f"--set {one}" for one in number.settings(float(f"{answer.values[place]:.6g}"))))
            )


def _write(of: str, curve: Path, out: Path, scene: Scene, numbers: list[Number], answer: Answer) -> None:
    """The scene with what was found, under a line that says of what."""
    found = ", ".join(
        f"{number.name} {value:.5g} ± {error:.2g} {number.unit}".rstrip()
        for number, value, error in zip(numbers, answer.values, answer.errors, strict=True)
    )
    head = f"# Made by `softseam fit {of} {curve.name}`: {found}\n"
    text = yaml.safe_dump(json.loads(scene_json(scene)), sort_keys=False, default_flow_style=None, width=110)
    write_whole(out, head + text)
