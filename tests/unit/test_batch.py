"""Many pieces in lanes of float32 do what the PBD solver does with each, whatever their place, number and threads."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from many_pieces import STEP, SUBSTEPS, drawn, scene, velocity
from pbd_run import Floats, PbdRun

from softseam.variants import with_settings
from softseam_protocol.scene.scene import Scene
from softseam_services.body.errors import SettingError
from softseam_services.pbd.batch import layout as rows
from softseam_services.pbd.batch.batch import Batch
from softseam_services.pbd.batch.pieces import Pieces

pytestmark = pytest.mark.kernels


def _run(batch: Batch, steps: range) -> list[bytes]:
    """What comes out of each piece, as bits."""
    for number in steps:
        batch.step(np.repeat(STEP * velocity(number)[None], batch.count, axis=0))
    return [batch.snapshot(piece) for piece in range(batch.count)]


def _von_mises(cauchy: Floats) -> float:
    s = cauchy.reshape(-1, 6)
    apart = (s[:, 0] - s[:, 1]) ** 2 + (s[:, 1] - s[:, 2]) ** 2 + (s[:, 2] - s[:, 0]) ** 2
    return float(np.sqrt(0.5 * apart + 3.0 * (s[:, 3:] ** 2).sum(axis=1)).max())


def test_a_lane_does_what_the_solver_does() -> None:
    """Squeezed by 10 % and lifted: places, forces, stress, slip and energy, to the roundings of float32."""
    tofu = scene()
    run, batch = PbdRun(tofu), Batch(tofu, 1, STEP, SUBSTEPS)
    moving = np.unique(run.solver.model.blocks.corners)
    for number in range(12):
        run.velocity[:] = velocity(number)
        reply, out = run.step(), batch.step(STEP * velocity(number)[None])
        assert reply.status == "converged" and not reply.alarms
        fields = run.fields()
        assert np.abs(fields.x[moving] - batch.places(0)).max() < 2e-6
        assert np.abs(reply.wrench[:, :3] - out.force[0]).max() < 1e-3 * max(1.0, np.abs(reply.wrench).max())
        assert out.stress[0] == pytest.approx(_von_mises(fields.cauchy), rel=3e-3)
        assert out.strain[0] == pytest.approx(reply.strain, rel=5e-3)
        assert out.slip[0] == pytest.approx(reply.extras["slip"], abs=2e-6)
    assert np.abs(reply.wrench[1]).max() > 1.0 and out.middle[0, 2] > 0.03


def test_friction_varies_over_a_piece_as_over_the_body_of_a_session() -> None:
    """Of a larger piece, its field told by the scene: each point has the friction that the solver's has, and slips so
    far, held by pads that are slippery here and there."""
    field = {"spread": 0.5, "length": 0.015, "seed": 4}
    tofu, larger = (
        with_settings(scene(2), [f"body.friction_field={json.dumps(field)}", *settings])
        for settings in ((), ("body.shape.size=[0.05, 0.052, 0.055]", "body.cell=[0.025, 0.026, 0.0275]"))
    )
    run, batch = PbdRun(larger), Batch(tofu, 1, STEP, SUBSTEPS)
    own = batch.structure.own(1)
    piece = replace(own, size=np.array([[0.05, 0.052, 0.055]]), friction=np.array([[0.6, 0.15, 0.15]]))
    batch.put(np.array([0]), piece)
    at, parameters = batch.structure.layout, run.solver.parameters.arrays
    pairs = np.frombuffer(batch.snapshot(0), np.float32)[at.pairs : at.out].reshape(-1, 3, rows.N_OF_PAIR)
    touching = run.solver.model.touches.any(axis=1)
    found, factor = pairs[:, :, rows.FRICTION], parameters.friction_factor[touching]
    np.testing.assert_allclose(found, factor[:, None] * piece.friction, rtol=1e-6)
    assert np.ptp(factor) > 0.8
    run = PbdRun(with_settings(larger, ["tools.left.friction=0.15", "tools.right.friction=0.15"]))
    for number in range(12):
        run.velocity[:] = velocity(number)
        reply, out = run.step(), batch.step(STEP * velocity(number)[None])
        assert out.slip[0] == pytest.approx(reply.extras["slip"], rel=0.01, abs=1e-6)
        assert np.abs(reply.wrench[:, :3] - out.force[0]).max() < 5e-3 * max(1.0, np.abs(reply.wrench).max())
    assert out.slip[0] > 5e-3


def test_bits_do_not_depend_on_place_number_or_threads() -> None:
    tofu, count = scene(2), 19
    many = Batch(tofu, count, STEP, SUBSTEPS)
    pieces = drawn(many)
    many.put(np.arange(count), pieces)
    found = _run(many, range(9))
    assert len(set(found)) == count
    two = Batch(tofu, count, STEP, SUBSTEPS, threads=2)
    two.put(np.arange(count), pieces)
    assert _run(two, range(9)) == found
    order = np.random.default_rng(1).permutation(count)
    mixed = Batch(tofu, count + 13, STEP, SUBSTEPS)
    mixed.put(order + 13, pieces)
    again = _run(mixed, range(9))
    assert [again[place + 13] for place in order] == found
    alone = Batch(tofu, 1, STEP, SUBSTEPS)
    for piece in (0, 7, 18):
        alone.put(np.array([0]), _only(pieces, piece))
        assert _run(alone, range(9)) == [found[piece]]


def _only(pieces: Pieces, piece: int) -> Pieces:
    return Pieces(**{name: value[piece : piece + 1] for name, value in vars(pieces).items()})


def test_a_piece_is_kept_and_put_back() -> None:
    """Elsewhere, and goes on with the same bits."""
    tofu = scene(2)
    batch, other = Batch(tofu, 3, STEP, SUBSTEPS), Batch(tofu, 11, STEP, SUBSTEPS)
    batch.put(np.arange(3), drawn(batch))
    kept = _run(batch, range(5))[2]
    other.restore(9, kept)
    assert _run(other, range(5, 9))[9] == _run(batch, range(5, 9))[2] != kept
    with pytest.raises(ValueError, match="of another scene"):
        other.restore(0, kept[:-4])


def test_what_can_be_no_lane_is_refused() -> None:
    for tofu, told in ((scene(2, retardation_time=0.005), "viscous"), (scene(2, kind="corotated"), "neo-Hookean")):
        with pytest.raises(SettingError, match=told):
            Batch(tofu, 1, STEP, SUBSTEPS)
    round_pad = scene(2).model_dump()
    round_pad["tools"]["left"] = {"kind": "sphere", "radius": 0.01, "position": [-0.05, 0, 0.03], "friction": 0.6}
    with pytest.raises(SettingError, match="boxes and planes only"):
        Batch(Scene.model_validate(round_pad), 1, STEP, SUBSTEPS)


def test_a_card_that_is_not_there_is_named() -> None:
    with pytest.raises(SettingError, match="leave device out"):
        Batch(scene(2), 1, STEP, SUBSTEPS, device="cuda")
