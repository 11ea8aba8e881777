"""`softseam fit` of a laboratory's curve: branches that made it are found again, and what is no such curve is named."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from rich.console import Console
from typer.testing import CliRunner

from softseam.app import app
from softseam.errors import BadInput
from softseam_studies.fit.branches import of_bar, of_sweep
from softseam_studies.fit.laboratory import fit_material

Floats = NDArray[np.float64]

MODULUS, TIME = np.array([4e3, 3e3, 2e3, 1e3]), np.array([0.01, 0.1, 1.0])


def sweep(noise: float = 0.0) -> tuple[Floats, Floats, Floats]:
    """Of MODULUS, the lasting one first, and TIME; frequencies whose decades are the times."""
    frequency = np.geomspace(1.0, 100.0, 21)
    x = np.outer(frequency, TIME)
    drawn = 1.0 + noise * np.random.default_rng(3).standard_normal((2, len(frequency)))
    storage, loss = MODULUS[0] + (x**2 / (1 + x**2)) @ MODULUS[1:], (x / (1 + x**2)) @ MODULUS[1:]
    return frequency, storage * drawn[0], loss * drawn[1]


def test_branches_of_a_sweep_are_found_again() -> None:
    found = of_sweep(*sweep())
    np.testing.assert_allclose(found.modulus, MODULUS, rtol=1e-6)
    np.testing.assert_allclose(found.time, TIME, rtol=1e-9)
    assert found.off < 1e-9


def test_standard_errors_are_those_of_the_noise() -> None:
    """Three of four moduli within two of their standard errors, and these as the noise is."""
    found, less = of_sweep(*sweep(0.02)), of_sweep(*sweep(0.002))
    assert found.off == pytest.approx(0.02, rel=0.3)
    assert np.count_nonzero(np.abs(found.modulus - MODULUS) < 2.0 * found.error) >= 3
    np.testing.assert_allclose(found.error, 10.0 * less.error, rtol=0.05)


def test_a_bar_that_is_held_relaxes_as_its_branches_do() -> None:
    """Of small strains, where a branch's stress over a ramp is known. A ramp of .2 s tells G t of .03 s
    and not G."""
    time = np.linspace(0.0, 3.0, 301)
    strain = 1e-4 * np.minimum(time / 0.2, 1.0)
    stress = 3.0 * 5e3 * strain
    for modulus, tau in ((2e3, 0.03), (3e3, 1.0)):
        rate, end = 1e-4 / 0.2, np.minimum(time, 0.2)
        stress = stress + 3.0 * modulus * rate * tau * (np.exp(-(time - end) / tau) - np.exp(-time / tau))
    found = of_bar(time, 1.0 + strain, stress)
    assert found.modulus[0] == pytest.approx(5e3, rel=0.02)
    assert float(found.modulus[1:] @ found.time) == pytest.approx(2e3 * 0.03 + 3e3 * 1.0, rel=0.05)
    assert found.off < 2e-3


def test_the_command_prints_the_material_and_draws_it(tmp_path: Path) -> None:
    path, picture = tmp_path / "sweep.csv", tmp_path / "sweep.png"
    rows = [f"{f:.6g},{s:.6g},{g:.6g}" for f, s, g in zip(*sweep(), strict=True)]
    path.write_text("\n".join(["frequency,storage,loss", *rows[::-1]]))
    found = CliRunner().invoke(app, ["fit", str(path), "--picture", str(picture)], env={"COLUMNS": "200"})
    assert found.exit_code == 0, found.output
    assert "material: {young: 29400," in found.output and "share: 0.3, time: 0.01" in found.output
    assert picture.stat().st_size > 10_000


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("frequency,storage,loss\n" + "1,2,1\n" * 9, r":3: the frequency 1 rad/s does not follow"),
        ("frequency,storage\n1,2\n", "columns are frequency, storage, loss"),
        ("frequency,storage,loss\n1,2e3,1\n2,2e3,1\n", "2 rows are too few"),
        ("frequency,storage,loss\n" + "".join(f"{k},-1,1\n" for k in range(1, 10)), ":2: a storage is above 0"),
        ("frequency,storage,loss\n" + "".join(f"{k},9.1,2.5\n" for k in range(1, 10)), "no soft solid's.*in Pa"),
        ("time,stretch,stress\n" + "".join(f"{k},{-k},1\n" for k in range(9)), r":2: a stretch is a length over"),
        ("time,stretch,stress\n" + "".join(f"{k},1,0\n" for k in range(9)), "nothing is pulled or pressed"),
    ],
)
def test_what_is_no_such_curve_is_named_with_its_line(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    path.write_text(text)
    with pytest.raises(BadInput, match=said):
        fit_material(path, None, Console(quiet=True))


@pytest.mark.parametrize(
    "given",
    [
        ("curve.csv", "--out", "fitted.yaml"),
        ("curve.csv", "--find", "friction"),
        ("curve.csv", "--runs", "3"),
        ("curve.csv", "--set", "step=0.01"),
        ("tofu_grasp", "curve.csv", "--picture", "fit.png"),
    ],
)
def test_wishes_that_the_other_fit_has_are_refused(given: tuple[str, ...]) -> None:
    found = CliRunner().invoke(app, ["fit", *given])
    assert found.exit_code != 0 and isinstance(found.exception, BadInput)


def test_a_scene_without_a_curve_is_asked_for_it() -> None:
    found = CliRunner().invoke(app, ["fit", "tofu_grasp"])
    assert found.exit_code != 0 and isinstance(found.exception, BadInput)
