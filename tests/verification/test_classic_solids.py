"""Solids by classic PBD: projections of volumes, blocks of tetrahedra, forces that follow from step and iterations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from particle_run import G, ParticleRun, particle_scene
from tet_bar import bar, vtk

from softseam_services.body.tet_mesh import tet_block
from softseam_services.body.tetrahedral_surface import outer_faces
from softseam_services.pbd.particles.batches import batches
from softseam_services.pbd.particles.kernels import volume
from softseam_services.pbd.particles.parameters import projection_shares
from softseam_services.pbd.particles.volume import VOLUME

EDGE = 0.05


def block(
    divisions: tuple[int, int, int] = (3, 3, 3),
    *,
    pbd: dict[str, Any] | None = None,
    step: float = 0.01,
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    tools: dict[str, Any] | None = None,
    **body: Any,
) -> ParticleRun:
    """A cube of 5 cm whose middle is at the origin, of 20 kPa and 1000 kg/m^3."""
    spec = {"kind": "tet_mesh", "size": (EDGE,) * 3, "divisions": divisions, "density": 1000.0, "young": 2e4}
    classic = {"method": "pbd", "substeps": 1, "sweeps": 20}
    scene = particle_scene(
        {**spec, "poisson": 0.3, **body}, pbd=classic if pbd is None else pbd, step=step, gravity=gravity, tools=tools
    )
    return ParticleRun(scene)


@pytest.mark.parametrize("share", [1.0, 0.3])
def test_a_projection_of_a_volume(share: float) -> None:
    """Eq. (1) with gradients by central differences; it leaves 1 - k of a small violation, and all momenta."""
    rng = np.random.default_rng(1)
    x, w = rng.normal(size=(4, 3)), rng.uniform(0.5, 2.0, 4)
    nodes = np.array([[0, 1, 2, 3]], dtype=np.int32)

    def size(at: np.ndarray) -> float:
        return float(np.linalg.det(at[1:] - at[0]) / 6.0)

    gradient = np.zeros((4, 3))
    for place in np.ndindex(4, 3):
        step = np.zeros((4, 3))
        step[place] = 1e-6
        gradient[place] = (size(x + step) - size(x - step)) / 2e-6
    rest = size(x) * (1.0 + 1e-4)
    made, xw = batches(4, nodes), np.zeros((12, 4))
    xw[:4, :3], xw[:4, 3] = x, w
    lam, lanes = np.zeros((1, 8)), made.lanes(np.array([rest]), 1.0)
    volume.project_volumes(np.zeros(volume.N_WORK), xw, made.nodes, lanes, share, lam)
    moved = xw[:4, :3] - x
    expected = -share * (size(x) - rest) / (w @ (gradient**2).sum(axis=1))
    np.testing.assert_allclose(moved, expected * w[:, None] * gradient, rtol=1e-6, atol=1e-12)
    assert lam.sum() == pytest.approx(expected, rel=1e-6)
    assert size(xw[:4, :3]) - rest == pytest.approx((1.0 - share) * (size(x) - rest), abs=1e-3 * 1e-4 * abs(rest))
    assert np.abs((moved / w[:, None]).sum(axis=0)).max() < 1e-15
    assert np.abs(np.cross(x, moved / w[:, None]).sum(axis=0)).max() < 1e-15
    own = np.zeros((4, 3))
    assert VOLUME.value(x, np.array([rest]), own) == pytest.approx(size(x) - rest, rel=1e-9)
    np.testing.assert_allclose(own, gradient, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("divisions", [(1, 1, 1), (2, 3, 4)])
def test_a_block_is_filled_by_five_tetrahedra_a_cube(divisions: tuple[int, int, int]) -> None:
    """They fill it, meet face to face, and have the block's mass, middle, and in a lattice alike masses inside."""
    size = (0.1, 0.2, 0.3)
    points, tetrahedra, share = tet_block(size, divisions)
    corners = points[tetrahedra]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0
    assert volumes.min() > 0.0 and volumes.sum() == pytest.approx(np.prod(size), rel=1e-12)
    outer = points[outer_faces(tetrahedra.astype(np.int64))[1]]
    area = 0.5 * np.cross(outer[:, 1] - outer[:, 0], outer[:, 2] - outer[:, 0])
    assert np.abs(np.linalg.norm(area, axis=1)).sum() == pytest.approx(2.0 * (0.02 + 0.03 + 0.06), rel=1e-12)
    assert np.einsum("ij,ij", area, outer.mean(axis=1)) / 3.0 == pytest.approx(np.prod(size), rel=1e-12)
    assert share.sum() == pytest.approx(1.0, rel=1e-12) and np.abs(share @ points).max() < 1e-15
    inside = (np.abs(points) < 0.49 * np.array(size)).all(axis=1)
    np.testing.assert_allclose(share[inside], 1.0 / np.prod(divisions), rtol=1e-12)


def test_a_block_keeps_momentum_and_shape() -> None:
    """Thrown and turning about x: what it had, and edges and volumes as they were, to 1 %."""
    run = block((2, 2, 2), rotation=(0.1, 0.2, 0.3), velocity=(0.1, 0.0, -0.2))
    run.v[:] += np.cross([2.0, 0.0, 0.0], run.body.x_rest)
    before = run.body.mass @ run.v, np.cross(run.x, run.body.mass[:, None] * run.v).sum(axis=0)
    last = run.run(0.2)
    np.testing.assert_allclose(last.momentum, before[0], rtol=1e-9, atol=1e-12)
    assert np.linalg.norm(last.angular_momentum - before[1]) < 0.05 * np.linalg.norm(before[1])
    assert last.extras["worst_stretch"] < 0.01 and not last.alarms


@pytest.mark.parametrize("sweeps", [5, 40])
def test_a_block_bears_its_weight(sweeps: int) -> None:
    """Contact's impulses: at rest the ground holds m g, however stiff the block is."""
    ground = {"ground": {"kind": "plane", "point": (0.0, 0.0, -0.5 * EDGE), "friction": 0.5}}
    pbd = {"method": "pbd", "substeps": 1, "sweeps": sweeps}
    run = block(pbd=pbd, gravity=(0.0, 0.0, -G), tools=ground, damping=20.0)
    last = run.run(1.0)
    assert last.wrench[0, 2] == pytest.approx(-G * 1000.0 * EDGE**3, rel=1e-3)
    assert last.extras["slip"] < 1e-4


def pressed(pbd: dict[str, Any], step: float = 0.01, **body: Any) -> float:
    """Force of the block on a lid that pressed it by a tenth, in 0.2 s, and rested for 0.3 s [N]."""
    plates = {
        "ground": {"kind": "plane", "point": (0.0, 0.0, -0.5 * EDGE), "friction": 0.5},
        "lid": {"kind": "box", "size": (0.1, 0.1, 0.01), "position": (0.0, 0.0, 0.5 * EDGE + 0.005), "friction": 0.5},
    }
    run = block(pbd=pbd, step=step, tools=plates, damping=5.0, **body)
    for n in range(round(0.5 / step)):
        run.velocity[1, 2] = -0.025 if n * step < 0.2 - 1e-9 else 0.0
        last = run.step()
    lower, upper = last.wrench[:, 2]
    assert lower == pytest.approx(-upper, rel=0.01)
    return float(upper)


def test_a_classic_block_s_force_follows_from_iterations_and_step_and_xpbd_s_does_not() -> None:
    """Failing control: at k = 1 a force of n m/h^2 times a length. XPBD on the same tetrahedra has E's, and twice the
    sweeps or half the substep change it by less than 3 %: between E A 10 % = 5 N and 1.4 times that, as faces stick."""

    def classic(n: int, step: float = 0.01, k: float = 1.0) -> float:
        shares = {"stretch": k, "volume": k}
        return pressed({"method": "pbd", "substeps": 1, "sweeps": n, "classic": shares}, step)

    once = classic(20)
    assert classic(40) / once == pytest.approx(2.0, rel=0.05)
    assert classic(20, step=0.005) / once == pytest.approx(4.0, rel=0.05)
    assert classic(20, k=0.3) / once < 0.5
    forces = [pressed({"substeps": 20 * m, "sweeps": n}, law="neo_hookean") for m, n in ((1, 1), (1, 2), (2, 1))]
    assert np.ptp(forces) < 0.03 * forces[0]
    assert 5.0 < forces[0] < 7.0


def test_a_share_per_substep_is_kept_by_any_number_of_iterations() -> None:
    """(1 - k')^n = 1 - k, of lengths and volumes."""
    for n in (1, 7):
        shares = {"stretch": 0.4, "volume": 0.7, "per_substep": True}
        run = block((1, 1, 1), pbd={"method": "pbd", "sweeps": n, "classic": shares})
        stretch, _, solid = projection_shares(run.solver.parameters.spec)
        assert (1.0 - stretch) ** n == pytest.approx(0.6, rel=1e-12)
        assert (1.0 - solid) ** n == pytest.approx(0.3, rel=1e-12)


@pytest.mark.parametrize("pbd", [{"method": "pbd", "substeps": 4, "sweeps": 10}, {}])
def test_slip_is_the_way_along_a_tool(pbd: dict[str, Any]) -> None:
    """A block glides on smooth ice as far as it goes; on what is rough enough it sticks, and wobbles."""
    for friction, way in ((0.0, 0.02), (50.0, 0.0)):
        ground = {"ground": {"kind": "plane", "point": (0.0, 0.0, -0.5 * EDGE), "friction": friction}}
        run = block((2, 2, 2), pbd=pbd, gravity=(0.0, 0.0, -G), tools=ground, damping=0.1)
        run.run(0.3)
        low = run.body.x_rest[:, 2] < -0.49 * EDGE
        run.v[:, 0] += 0.1
        before = run.x[low, 0].copy()
        last = run.run(0.2)
        gone = run.x[low, 0] - before
        assert gone.mean() == pytest.approx(way, rel=0.05, abs=1e-4)
        assert last.extras["slip"] == pytest.approx(gone.max(), rel=0.05, abs=3e-4)


def test_a_lifted_block_slips_anew() -> None:
    """What it slid counts from where it touched last."""
    run = block((1, 1, 1), tools={"ground": {"kind": "plane", "point": (0.0, 0.0, -0.5 * EDGE), "friction": 0.0}})
    run.v[:] = (0.1, 0.0, -0.01)
    assert run.step().extras["slip"] == pytest.approx(1e-3, rel=0.01)
    run.v[:] = (0.1, 0.0, 0.5)
    assert run.step().extras["slip"] == 0.0


def test_a_block_inside_out_is_told_of() -> None:
    run = block((1, 1, 1))
    run.x[:] = run.body.x_rest * [1.0, 1.0, -1.0]
    run.solver._measure(run.x)
    assert "5 tetrahedra are crushed to nothing or inside out: take a shorter step" in run.solver._alarm()


def test_a_file_s_tetrahedra_hang_by_classic_pbd() -> None:
    """Stiffer with each iteration: the failing control of a bar that XPBD lets hang as its closed form."""
    tips = []
    for n in (10, 40):
        spec = {"kind": "tet_mesh", "path": "bar.vtk", "density": 1000.0, "young": 2e4, "poisson": 0.3, "damping": 15.0}
        clamp = ({"min": (-9.0, -9.0, -9.0), "max": (-0.1, 9.0, 9.0)},)
        scene = particle_scene(
            {**spec, "fixed": clamp},
            gravity=(G, 0.0, 0.0),
            pbd={"method": "pbd", "substeps": 1, "sweeps": n, "classic": {"stretch": 0.1, "volume": 0.1}},
        )
        run = ParticleRun(scene, {"bar.vtk": vtk(*bar((4, 1, 1), (0.2, 0.05, 0.05)))})
        run.run(1.0)
        tips.append(float((run.x - run.body.x_rest)[:, 0].max()))
    assert tips[0] > 3.0 * tips[1] > 0.0
