"""What a chart keeps and reads: whole or refused by name; and what is drawn of runs that went wrong."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from softseam.errors import BadInput
from softseam.scenes import load_scene
from softseam.variants import AS_GIVEN, with_settings
from softseam_protocol.scene.bodies import BlockShape, BodySpec
from softseam_protocol.scene.particles import TetMeshBody
from softseam_services.body.build import build_body
from softseam_studies.study.classic import classic_configurations
from softseam_studies.study.configurations import Configuration, Fem, configurations
from softseam_studies.study.errors import Truth
from softseam_studies.study.frame import Frame, frame_of
from softseam_studies.study.landmarks import ASKED, asked_of, read_rivals
from softseam_studies.study.measure import BRIEF, MOST, Outcome, measure, quantity_names
from softseam_studies.study.reference import Part, Reference
from softseam_studies.study.series import Series
from softseam_studies.study.store import Identity, Store, cache_folder
from softseam_studies.study.study import study_of
from softseam_studies.study.sweep import sweep
from softseam_studies.study.table import rows_of, write_csv

HERE = Identity("a scene", "some code", "a machine")
SERIES = Series(np.array([0.1, 0.2]), np.zeros(2), {"sag": np.array([1.0, 2.0])})
DONE = Outcome("done", series=SERIES, walls=(0.02, 0.01, 0.04), simulated=0.2, steps=2)


def test_an_outcome_is_read_as_it_was_written(tmp_path: Path) -> None:
    store = Store(tmp_path, HERE, "start anew")
    store.write("run", DONE.as_json())
    data = store.read("run")
    assert data is not None
    again = Outcome.from_json(data)
    assert again.walls == DONE.walls and again.rtf == pytest.approx(10.0)
    assert again.series is not None
    np.testing.assert_array_equal(again.series.values["sag"], SERIES.values["sag"])
    assert store.read("another") is None
    assert [path.name for path in tmp_path.iterdir()] == ["run.json"]


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (lambda text: text[: len(text) // 2], "is corrupt: it is not JSON"),
        (lambda text: "[]", "was not written by softseam chart"),
        (lambda text: text.replace("0.02", "0.03"), "do not match its digest"),
        (lambda text: text.replace("a scene", "b scene"), "belongs to another scene"),
        (lambda text: text.replace("some code", "more code"), "belongs to other code"),
        (lambda text: text.replace("a machine", "b machine"), "another machine (b machine)"),
        (lambda text: text.replace('"softseam_chart": 1', '"softseam_chart": 99'), "another version"),
    ],
)
def test_a_spoilt_or_foreign_file_is_refused_by_name(tmp_path: Path, spoil: object, why: str) -> None:
    store = Store(tmp_path, HERE, "start anew with --fresh")
    store.write("run", DONE.as_json())
    path = tmp_path / "run.json"
    assert callable(spoil)
    path.write_text(spoil(path.read_text()))
    with pytest.raises(BadInput) as caught:
        store.read("run")
    assert str(path) in str(caught.value) and why in str(caught.value) and "--fresh" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{", "is not JSON"),
        ("[]", "expected"),
        ('{"rivals": [7]}', "row 1 is not an object"),
        ('{"rivals": [{"label": "A", "rtf": 1}]}', "row 1 lacks error, source"),
        ('{"rivals": [{"label": "A", "rtf": -1, "error": 0.1, "source": "me"}]}', "rtf is -1"),
        ('{"rivals": [{"label": "A", "rtf": 1, "error": "low", "source": "me"}]}', "error is 'low'"),
    ],
)
def test_bad_rivals_are_refused_with_the_row(tmp_path: Path, text: str, why: str) -> None:
    path = tmp_path / "rivals.json"
    path.write_text(text)
    with pytest.raises(BadInput, match=r"rivals\.json") as caught:
        read_rivals(path, "tofu")
    assert why in str(caught.value)


def test_a_cache_that_cannot_be_written_is_told_of_when_it_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "taken").write_text("a file")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "taken"))
    store = Store(cache_folder() / "scene", HERE, "start anew")
    assert store.read("run") is None and not store.names("")
    with pytest.raises(BadInput, match=r"cannot write .*run\.json: .*: set XDG_CACHE_HOME to a folder"):
        store.write("run", DONE.as_json())


def test_rivals_of_other_scenes_are_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "rivals.json"
    row = {"label": "A", "rtf": 1.5, "error": 0.1, "source": "me"}
    path.write_text(json.dumps({"rivals": [row | {"scene": "tofu"}, row | {"scene": "other"}, row]}))
    assert [mark.rtf for mark in read_rivals(path, "tofu")] == [1.5, 1.5]
    with pytest.raises(BadInput, match="cannot be read"):
        read_rivals(tmp_path / "none.json", "tofu")


def test_a_sweep_names_every_configuration_once() -> None:
    scene = load_scene("tofu_grasp")
    found = configurations(Frame(scene, np.array([0.05, 0.05, 0.05])))
    assert len({c.key for c in found}) == len({c.label for c in found}) == len(found)
    assert [c.seconds for c in found] == sorted(c.seconds for c in found)
    assert {c.method for c in found} == {"FEM", "FEM, other elements", "XPBD", "hybrid", "as it is"}


def test_classic_pbd_is_a_control_of_charts_and_no_choice_of_plans() -> None:
    """The scene takes each one's settings; only blocks of one material are tried, and where nothing that counts has
    cells alone. k = 1 at 5 to 80 iterations, and a k for E that falls with iterations and with longer cubes."""
    scene = load_scene("tofu_grasp")
    frame = Frame(scene, np.array([0.05, 0.05, 0.05]))
    found = classic_configurations(frame)
    assert {one.method for one in found} == {"PBD"} and not {one.method for one in configurations(frame)} & {"PBD"}
    assert len({one.key for one in found}) == len({one.label for one in found}) == len(found)
    shares = {}
    for one in found:
        asked = with_settings(scene, one.settings)
        assert isinstance(asked.body, TetMeshBody) and asked.body.size == (0.05, 0.05, 0.05)
        assert asked.body.position == (0.0, 0.0, 0.025) and "peak_von_mises" not in asked.quantities
        assert asked.models.pbd.classic.stretch == asked.models.pbd.classic.volume
        shares[asked.body.divisions, asked.step, asked.models.pbd.sweeps, asked.models.pbd.classic.stretch < 1.0] = (
            asked.models.pbd.classic.stretch
        )
    assert shares[(2, 2, 2), 0.01, 80, True] == pytest.approx(2.0 * 20e3 / 1050 * (0.01 / 0.025) ** 2 / 80, rel=1e-5)
    assert {n for (counts, _, n, softer) in shares if counts == (6, 6, 6) and not softer} == {5, 20, 80}
    assert {step for (_, step, _, _) in shares} == {0.005, 0.01, 0.02}
    for name in ("tofu_pads", "stiff_inclusion", "sausage", "rope"):
        assert classic_configurations(Frame(load_scene(name), np.full(3, 0.05))) == [], name
    core = "body.inclusions=[{shape: {kind: sphere, radius: 0.01, position: [0, 0, 0.025]}, material: {young: 1.0e5}}]"
    for other in (core, "body.spin=[0, 0, 1]", "quantities=[grip_force, von_mises_p99]"):
        assert classic_configurations(Frame(with_settings(scene, [other]), np.full(3, 0.05))) == [], other


@pytest.mark.kernels
def test_what_a_run_never_tells_is_in_no_series() -> None:
    """Particles have no stress; a quantity that is lost at the end, the control, makes a run fail."""
    settings = classic_configurations(Frame(load_scene("tofu_grasp"), np.full(3, 0.05)))[0].settings
    short = (*settings, "motion=[]", "duration=0.03")
    outcome = measure("tofu_grasp", short, ("grip_force", "peak_von_mises"), runs=0)
    assert outcome.status == "done" and outcome.series is not None
    assert [*outcome.series.values] == ["grip_force"] and outcome.series.finite()
    assert not replace(outcome.series, values={"grip_force": np.array([0.0, np.nan])}).finite()


def test_a_sweep_ends_cells_at_edges_inside_faces() -> None:
    """The pads' edges lie inside faces, plates cover theirs; the ground has no edge. The scene takes the settings."""
    towards = [c for c in configurations(Frame(load_scene("tofu_pads"), np.full(3, 0.05))) if "to edges" in c.label]
    assert towards and all('body.shape.towards=["left", "right"]' in c.settings for c in towards)
    shape = with_settings(load_scene("tofu_pads"), towards[0].settings).body
    assert isinstance(shape, BodySpec) and isinstance(shape.shape, BlockShape)
    assert shape.shape.towards == ("left", "right")
    assert not Frame(load_scene("tofu_grasp"), np.full(3, 0.05)).edged
    assert not Frame(load_scene("dumpling"), np.full(3, 0.05)).edged


def test_a_sweep_thins_few_cells_towards_edges_along_one_axis_at_a_time() -> None:
    """Where edges lie well inside a face: tofu_push's plate ends half a millimetre from one."""

    def few(name: str, extent: list[float]) -> set[str]:
        frame = Frame(load_scene(name), np.array(extent))
        labels = {c.label.partition(",")[0] for c in configurations(frame)}
        return {label.removeprefix("FEM ") for label in labels if " to edges" in label}

    found = few("tofu_pads", [0.05] * 3)
    for across in (2, 4):
        cells = f"{across}x6x6 to edges"
        assert {cells, f"{cells} graded 1x1x4", f"{cells} graded 1x4x1", f"{cells} graded 1x4x4"} <= found
    assert "7x6x4 to edges graded 4x1x1" in few("tofu_slab", [0.24, 0.16, 0.06])
    assert not any("x1x" in label for label in few("tofu_push", [0.06, 0.06, 0.04]))
    frame = Frame(load_scene("tofu_pads"), np.full(3, 0.05))
    thin = next(c for c in configurations(frame) if "4x6x6 to edges graded 1x1x4" in c.label)
    body = with_settings(frame.scene, thin.settings).body
    assert isinstance(body, BodySpec) and isinstance(body.shape, BlockShape)
    assert body.shape.gradings == (1.0, 1.0, 4.0) and body.shape.towards == ("left", "right")


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["tofu_pads", "tofu_slab", "tofu_push", "heavy_on_soft"])
def test_cells_to_edges_are_those_that_are_named(name: str) -> None:
    """Each piece between edges has whole cells; and an even number, where FEM solves for one side of them."""
    settings = (*AS_GIVEN, *({"tofu_pads": ("symmetry=[x, y]",), "tofu_slab": ("symmetry=[y]",)}.get(name, ())))
    scene = with_settings(load_scene(name), settings)
    frame = frame_of(scene, name, settings)
    edged = [one for one in configurations(frame) if one.fem is not None and one.fem.towards and one.fem.n_cells < 900]
    assert len(edged) >= 3
    for one in edged:
        assert one.fem is not None and one.fem.n_cells == len(
            build_body(with_settings(scene, one.settings), {}).cell_nodes
        )
        assert all(one.fem.counts[axis] % 2 == 0 for axis in frame.mirrors), one.label


def test_what_a_run_says_of_its_own_errors_is_not_compared() -> None:
    scene = load_scene("tofu_grasp").model_copy(update={"quantities": ("mesh_error", "sag", "traction_jump")})
    assert quantity_names(scene) == ("sag",)
    with pytest.raises(BadInput, match="asks for no quantities to compare"):
        quantity_names(scene.model_copy(update={"quantities": ("mesh_error",)}))


def test_cells_are_longer_along_what_only_cylinders_press() -> None:
    """The fingers of sausage_bend reach across it; one that ends inside, or stands askew, presses it unevenly."""
    scene, extent = load_scene("sausage_bend"), np.array([0.12, 0.02, 0.02])
    frame = Frame(scene, extent)
    assert frame.even == 2 and frame.across(4) == (24, 4, 2) and frame.across(8) == (48, 8, 4)
    assert frame.size(frame.across(3)) == pytest.approx(0.02 / 3) == frame.size((18, 3, 1))
    labels = {c.label for c in configurations(frame)}
    assert {"FEM 18x3x1, 10 ms", "FEM 24x4x1, 10 ms", "FEM 24x4x2, 10 ms", "FEM 48x4x2, 10 ms"} <= labels
    for setting in ("tools.middle.length=0.019", "tools.middle.axis=[0, 0.1, 1]", "tools.middle.position=[0, 0.02, 0]"):
        assert Frame(with_settings(scene, (setting,)), extent).even is None
    core = "body.inclusions=[{shape: {kind: box, position: [0, 0, 0], size: [0.1, 0.1, 0.02]}, material: {young: 1e5}}]"
    assert Frame(with_settings(scene, (core,)), extent).even is None
    assert Frame(load_scene("tofu_grasp"), np.full(3, 0.05)).even is None
    assert Frame(load_scene("cantilever"), np.full(3, 0.05)).even is None


def test_levels_of_a_reference_are_finer_across_lines_of_contact() -> None:
    """Fingers press sausage_bend along y and lie along z; how it moves depends on cells along x: 48 are as near as 144.
    Fingers on different faces leave no axis for that."""
    scene, extent = load_scene("sausage_bend"), np.array([0.12, 0.02, 0.02])
    frame = Frame(scene, extent)
    assert frame.narrow == 0 and frame.across(4) == (24, 4, 2) and frame.level(4) == (48, 4, 2)
    corner = Frame(with_settings(scene, ("tools.middle.position=[0.08, 0, 0.01]",)), extent)
    assert corner.even == 2 and corner.narrow is None and corner.level(4) == corner.across(4)
    grasp = Frame(load_scene("tofu_grasp"), np.full(3, 0.05))
    assert grasp.narrow is None and grasp.level(4) == (4, 4, 4)


def test_one_cell_is_tried_along_what_nothing_acts_along() -> None:
    """The plates of tofu_grasp cover it along y, close along x and lift along z. Shorter, turned or aside they do not
    cover it; nor is an axis idle that gravity or a motion has a part along, or the ground leans to."""
    scene, extent = load_scene("tofu_grasp"), np.full(3, 0.05)
    frame = Frame(scene, extent)
    assert frame.idle == 1 and frame.even is None
    labels = {c.label for c in configurations(frame)}
    assert {"FEM hex27_reduced 4x1x4, 40 ms", "FEM hex27_reduced 3x1x2, 30 ms"} <= labels
    for setting in (
        "tools.left.size=[0.01, 0.049, 0.06]",
        "tools.left.rotation=[0, 0, 0.1]",
        "tools.left.position=[-0.0431, 0.001, 0.029]",
        "tools={left: {kind: box, size: [0.01, 0.06, 0.06], position: [-0.0431, 0.006, 0.029]}, right: {kind: box, "
        "size: [0.01, 0.06, 0.06], position: [0.0431, 0.006, 0.029]}}",
        "tools.ground.normal=[0, 0.1, 1]",
        "tools.left={kind: sphere, radius: 0.1, position: [-0.15, 0, 0.029]}",
        "gravity=[0, 0.1, -9.81]",
        "body.velocity=[0, 0.1, 0]",
        "motion=[{tools: [left, right], move: [0, 0.01, 0.05], speed: 0.05}]",
        "motion=[{tools: [left, right], turn: [0, 0.1, 0], speed: 0.05}]",
    ):
        other = Frame(with_settings(scene, (setting,)), extent)
        assert other.idle is None, setting
        assert not any("x1x" in c.label and "1x1x1" not in c.label for c in configurations(other))
    assert Frame(with_settings(scene, ("tools.left.rotation=[0, 0.1, 0]",)), extent).idle == 1
    assert Frame(load_scene("cantilever"), extent).idle is None and Frame(load_scene("tofu_pads"), extent).idle is None


@pytest.mark.parametrize(
    ("setting", "even"),
    [
        ("body.fixed=[{min: [-1, -1, -1], max: [1, 1, 0.001]}]", None),
        ("gravity=[0, 0, -9.81]", None),
        ("gravity=[0, -9.81, 0]", 2),
        ("body.velocity=[0, 0, 0.1]", None),
        ("body.velocity=[0, 0.1, 0]", 2),
        ("body.spin=[0, 1, 0]", None),
        ("motion=[{tools: [middle], move: [0, -0.03, 0.001], speed: 0.05}]", None),
        ("motion=[{tools: [middle], turn: [0.1, 0, 0], speed: 0.5}]", None),
        ("motion=[{tools: [first, second], close: 0.01, until: {time: 0.1}}]", 2),
    ],
)
def test_cells_are_longer_only_where_all_happens_across(setting: str, even: int | None) -> None:
    """What clamps, pulls, moves or turns along the cylinders changes along them."""
    scene = with_settings(load_scene("sausage_bend"), (setting,))
    assert Frame(scene, np.array([0.12, 0.02, 0.02])).even == even


def test_cylinders_that_close_askew_press_unevenly() -> None:
    askew = (
        "tools.first.position=[-0.045, -0.0165, 0.011]",
        "motion=[{tools: [first, second], close: 0.01, until: {time: 0.1}}]",
    )
    scene = with_settings(load_scene("sausage_bend"), askew)
    assert Frame(scene, np.array([0.12, 0.02, 0.02])).even is None


def test_plain_cells_do_not_end_at_edges_where_a_scene_asks_for_that() -> None:
    """Nor do the reference's, which are plain ones."""
    scene = with_settings(load_scene("tofu_pads"), ("body.shape.towards=[left, right]",))
    frame = Frame(scene, np.full(3, 0.05))
    plain = with_settings(scene, Fem(frame, frame.across(3), 0.01).settings).body
    assert isinstance(plain, BodySpec) and isinstance(plain.shape, BlockShape) and plain.shape.towards == ()


@pytest.mark.kernels
def test_a_swept_run_is_looked_at_in_every_step(tmp_path: Path) -> None:
    """What is looked at seldom would be judged at a few instants of a run in long steps."""
    study = study_of("tofu_push", ("quantities=[]",))
    one = Fem(study.frame, (2, 2, 1), 0.04).configuration()
    store = Store(tmp_path, Identity("scene", "code"), "")
    series = sweep(study, [one], store, 60.0, lambda what, rough: lambda done: None, 0)[one.key].series
    assert series is not None
    assert (series.looked("front.von_mises") == series.time[1:]).all() and len(series.time) > 20


@pytest.mark.kernels
@pytest.mark.slow
def test_processes_side_by_side_find_the_same_and_store_it(tmp_path: Path) -> None:
    study = study_of("tofu_push", ("motion=[{hold: 0.05}]",))
    wanted = [Fem(study.frame, (n, n, 1), 0.01).configuration() for n in (1, 2, 3)]
    wanted.append(Configuration("bad", "FEM", "bad", ("step=5.0",), 1e-3))
    found = []
    for jobs in (1, 2):
        store = Store(tmp_path / str(jobs), Identity("scene", "code"), "")
        ended = sweep(study, wanted, store, 60.0, lambda what, rough: lambda done: None, 0, jobs)
        assert {path.stem for path in store.folder.glob("*.json")} == {*ended} == {one.key for one in wanted}
        found.append({key: (one.status, one.reason, one.series and one.series.as_json()) for key, one in ended.items()})
    assert found[0] == found[1] and found[0]["bad"][0] == "refused"


def test_cells_follow_the_body() -> None:
    frame = Frame(load_scene("tofu_grasp"), np.array([0.24, 0.16, 0.06]))
    assert frame.across(1) == (4, 3, 1) and frame.across(2) == (8, 5, 2)
    assert frame.own == (14, 6, 2)
    assert frame.cells((4, 3, 1)) == (f"body.cell={[0.06, 0.16 / 3, 0.06]}",)


def test_a_setting_that_the_scene_refuses_is_an_outcome() -> None:
    found = measure("tofu_grasp", ("step=5.0",), ("sag",))
    assert found.status == "refused" and "step" in found.reason and found.rtf == 0.0


def test_rows_tell_what_failed(tmp_path: Path) -> None:
    """Failed, stopped and unfinished runs are rows with their reason, in the table and in the picture."""
    reference = Reference(
        SERIES.time,
        {"sag": Truth(SERIES.values["sag"], 1.6, 0.01)},
        {"sag": Part(0.005, 0.005, 1.0, float("nan"), 0.01)},
        (),
        "bdf2",
        True,
    )
    outcomes = {
        "good": DONE,
        "bad": Outcome("failed", "it diverged", walls=(0.5,), simulated=0.1),
        "slow": replace(DONE, walls=(0.5,)),
        "dear": Outcome("left out", "a run would take some 99 s"),
    }
    wanted = [Configuration(key, "XPBD", f"the {key} one", ("step=0.1",), 1.0) for key in outcomes]
    rows = rows_of(wanted, outcomes, reference)
    assert [row.front for row in rows] == [True, False, False, False]
    assert rows[0].error is not None and rows[0].error.bound and rows[0].error.value == 0.01
    assert rows[1].reason == "failed: it diverged"
    write_csv(rows, ["sag"], tmp_path / "chart.csv")
    lines = (tmp_path / "chart.csv").read_text().splitlines()
    assert len(lines) == 5 and "it diverged" in lines[2] and lines[1].endswith("0.01,true")
    from softseam.view.paper import write
    from softseam_studies.study.draw import draw_chart, placed

    assert placed(rows[1]) == (0.1 / 0.5, 1.0, True) and placed(rows[3]) is None
    picture = write(draw_chart("a test", "a machine", rows, reference, ASKED, ASKED[:1]), tmp_path / "chart.png")
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_what_was_asked_for_is_in_the_chart_of_its_scene_alone() -> None:
    """A stranger's own scene has no targets of softseam's: nobody asked it for them."""
    assert asked_of("tofu_grasp") == ASKED and asked_of("my_grasp") == asked_of("cantilever") == ()


@pytest.mark.kernels
def test_brief_runs_are_timed_more_often_than_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Until they took BRIEF together, or were MOST; what is not to be timed at all is its first run, once."""
    settings = ("regions={default: fem}", "body.cell=0.05", "step=0.08")
    found = measure("tofu_grasp", settings, ("sag",), runs=1)
    assert 1 < len(found.walls) <= MOST and (len(found.walls) == MOST or found.spent > BRIEF)
    # of one run, not of all; and two clocks differ by some microseconds
    assert found.cpu <= 1.05 * sorted(found.walls)[len(found.walls) // 2]
    assert len(measure("tofu_grasp", settings, ("sag",), runs=0).walls) == 1
    monkeypatch.setattr("softseam_studies.study.measure.BRIEF", 0.0)
    assert len(measure("tofu_grasp", settings, ("sag",), runs=2).walls) == 2
