"""Sheets against plate and membrane theory, Coulomb's law, free fall with bounces; layers that may not cross."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from particle_run import Floats, G, ParticleRun, particle_scene

from softseam_services.body.particles import ParticleBody


def sheet(**other: Any) -> dict[str, Any]:
    return {"kind": "sheet", "size": (0.2, 0.2), "divisions": (8, 8), "density": 0.2, "stretch": 100.0, **other}


def build(**other: Any) -> ParticleBody:
    return ParticleRun(particle_scene(sheet(**other))).body


def stretched(body: ParticleBody, x: Floats) -> float:
    """Energy of the springs at positions x (n, 3) [J]."""
    springs = body.springs
    length = np.linalg.norm(x[springs.nodes[:, 1]] - x[springs.nodes[:, 0]], axis=1)
    return float(0.5 * springs.stiffness @ (length - springs.rest) ** 2)


def bent(body: ParticleBody, x: Floats) -> float:
    """Energy of the bends at positions x (n, 3) [J]."""
    bends = body.bends
    value = np.einsum("mi,mic->mc", bends.coefficient, x[bends.nodes])
    return float(0.5 * bends.stiffness @ np.einsum("mc,mc->m", value, value))


@pytest.mark.parametrize("divisions", [(8, 8), (8, 10), (11, 8)])
@pytest.mark.parametrize("shear", [None, 15.0])
@pytest.mark.parametrize("strain", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -0.4, 0.7)])
def test_a_lattice_has_the_stiffness_of_its_membrane(
    divisions: tuple[int, int], shear: float | None, strain: tuple[float, float, float]
) -> None:
    """Uniform small strain: energy per area 1/2 (C11 (ex^2 + ey^2) + 2 C12 ex ey + G g^2), C12 = G."""
    body = build(divisions=divisions, shear=shear)
    ex, ey, g = 1e-6 * np.array(strain)
    x = body.x_rest.copy()
    x[:, 0] += ex * body.x_rest[:, 0] + g * body.x_rest[:, 1]
    x[:, 1] += ey * body.x_rest[:, 1]
    c12 = 37.5 if shear is None else shear
    c11 = 0.5 * (100.0 + np.hypot(100.0, 2.0 * c12))
    assert c11 - c12**2 / c11 == pytest.approx(100.0)
    expected = 0.5 * (c11 * (ex**2 + ey**2) + 2.0 * c12 * ex * ey + c12 * g**2) * 0.04
    assert stretched(body, x) == pytest.approx(expected, rel=1e-5, abs=0.0)


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4, np.pi / 2])
def test_bending_does_not_know_the_lattice(angle: float) -> None:
    """Rolled about any axis, w = k s^2/2: the energy is D/2 k^2 times the area that rows and cells cover."""
    body = build(bending=1e-4, divisions=(20, 20))
    direction = np.array([np.cos(angle), np.sin(angle), 0.0])
    x = body.x_rest.copy()
    curvature = 0.1
    x[:, 2] = 0.5 * curvature * (body.x_rest @ direction) ** 2
    # rows end one spacing short of both borders, so w_xx^2 counts on 19/20 of the sheet, the twist on all of it
    share = (direction[0] ** 4 + direction[1] ** 4) * 19 / 20 + 2.0 * (direction[0] * direction[1]) ** 2
    assert bent(body, x) == pytest.approx(0.5 * 1e-4 * curvature**2 * 0.04 * share, rel=1e-6, abs=0.0)


def test_a_sheet_hangs_over_an_edge_as_a_cantilever_strip() -> None:
    """w = q L'^4/(8 D) per width, 2 % of the length, L' from the middle between the two clamped rows: within 2 %."""
    length, bending = 0.2, 1e-3
    density = 0.02 * length * 8.0 * bending / (G * length**4)
    body = sheet(
        size=(length, 0.04),
        divisions=(20, 4),
        density=density,
        bending=bending,
        stretch=1e3,
        damping=20.0,
        self_contact=False,
        fixed=[{"min": (-0.1, -1.0, -1.0), "max": (-0.09, 1.0, 1.0)}],
    )
    run = ParticleRun(particle_scene(body, gravity=(0.0, 0.0, -G), pbd={"substeps": 80, "sweeps": 10}))
    run.run(1.5)
    tip = run.x[np.isclose(run.body.x_rest[:, 0], 0.1), 2].mean()
    assert -tip == pytest.approx(0.02 * length * 0.975**4, rel=0.02)


@pytest.mark.parametrize("steep", [0.9, 1.2])
def test_friction_on_an_incline(steep: float) -> None:
    """tan(slope) = 0.9 mu: it sticks to 1e-9 m; 1.2 mu: it slides with g (sin - mu cos)."""
    mu = 0.5
    slope = np.arctan(steep * mu)
    gravity = (G * np.sin(slope), 0.0, -G * np.cos(slope))
    tools = {"ground": {"kind": "plane", "friction": mu}}
    body = sheet(position=(0.0, 0.0, 0.005), thickness=0.01, self_contact=False)
    run = ParticleRun(particle_scene(body, gravity=gravity, tools=tools, pbd={"substeps": 10}))
    reply = run.run(0.5)
    moved = (run.x - run.body.x_rest)[:, 0]
    h = 0.001
    if steep < 1.0:
        assert np.abs(moved).max() < 1e-9
    else:
        acceleration = G * (np.sin(slope) - mu * np.cos(slope))
        assert moved == pytest.approx(0.5 * acceleration * 0.5 * (0.5 + h), rel=1e-6)
    weight = run.body.total_mass * G * np.cos(slope)
    assert reply.wrench[0, 2] == pytest.approx(-weight, rel=1e-9)
    assert reply.wrench[0, 0] == pytest.approx(min(steep, 1.0) * mu * weight, rel=1e-6)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.9])
def test_a_bounce_keeps_its_share_of_the_speed(restitution: float) -> None:
    """Dropped by 0.2 m on a plane: it rises to e^2 0.2 m, within what a substep of falling leaves open."""
    tools = {"ground": {"kind": "plane"}}
    body = sheet(
        position=(0.0, 0.0, 0.205), thickness=0.01, restitution=restitution, divisions=(2, 2), self_contact=False
    )
    run = ParticleRun(particle_scene(body, gravity=(0.0, 0.0, -G), tools=tools, pbd={"substeps": 20}))
    fall = np.sqrt(2.0 * 0.2 / G)
    run.run(fall + 0.05)
    top = max(run.step().bounds[1, 2] for _ in range(60)) - 0.005
    assert top == pytest.approx(restitution**2 * 0.2, abs=0.005)


@pytest.mark.parametrize("kind", ["box", "sphere", "capsule", "cylinder", "mesh"])
def test_a_sheet_lies_on_tools_of_every_kind(kind: str) -> None:
    """It comes to rest on the tool's top, which bears its weight, and stays half its thickness away."""
    shapes: dict[str, dict[str, Any]] = {
        "box": {"size": (0.3, 0.3, 0.1)},
        "sphere": {"radius": 0.05},
        "capsule": {"radius": 0.05, "length": 0.3, "axis": (1.0, 0.0, 0.0)},
        "cylinder": {"radius": 0.2, "length": 0.1},
        "mesh": {},
    }
    if kind == "mesh":
        pytest.importorskip("meshio")
    tool: dict[str, Any] = {"kind": kind, "position": (0.0, 0.0, -0.05), "friction": 0.5, **shapes[kind]}
    files = {}
    if kind == "mesh":
        corners = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
        quads = ((1, 3, 4, 2), (5, 6, 8, 7), (1, 2, 6, 5), (3, 7, 8, 4), (1, 5, 7, 3), (2, 4, 8, 6))
        lines = [f"v {3 * x} {3 * y} {z}" for x, y, z in corners]
        lines += [f"f {a} {b} {c}\nf {a} {c} {d}" for a, b, c, d in quads]
        files["slab.obj"] = "\n".join(lines).encode()
        tool |= {"path": "slab.obj", "scale": 0.1}
    body = sheet(position=(0.0, 0.0, 0.0101), thickness=0.02, self_contact=False, damping=5.0, divisions=(10, 10))
    scene = particle_scene(body, gravity=(0.0, 0.0, -G), tools={"table": tool})
    run = ParticleRun(scene, files)
    reply = run.run(1.0)
    assert reply.extras["penetration"] < 1e-4
    if kind in ("box", "cylinder", "mesh"):
        reply = run.step()
        assert reply.wrench[0, 2] == pytest.approx(-run.body.total_mass * G, rel=0.01)
        assert run.x[:, 2] == pytest.approx(0.01, abs=2e-4)
    else:
        assert run.x[:, 2].max() == pytest.approx(0.01, abs=1e-3)


def test_layers_of_a_fold_do_not_cross() -> None:
    """Folded in half in the air and dropped: the upper layer stays on the lower one; without contact it falls through.

    Heights are compared with the highest particle of the lower layer within a spacing: balls of 7.5 mm that sink
    between four others 10 mm apart stay sqrt(7.5^2 - 50) = 2.5 mm above them.
    """
    apart = {}
    for keeps in (True, False):
        body = sheet(
            size=(0.2, 0.1), divisions=(20, 10), self_contact=keeps, thickness=0.0075, position=(0.0, 0.0, 0.00375)
        )
        tools = {"ground": {"kind": "plane", "friction": 0.5}}
        run = ParticleRun(particle_scene(body, gravity=(0.0, 0.0, -G), tools=tools, pbd={"substeps": 20}))
        upper = run.body.x_rest[:, 0] > 1e-6
        turned = run.x[upper].copy()
        run.x[upper, 0] = -turned[:, 0] + 0.004
        run.x[upper, 2] = turned[:, 2] + 0.02 + 0.2 * turned[:, 0]
        run.run(1.0)
        lower = run.x[~upper]
        gaps = []
        for at in run.x[run.body.x_rest[:, 0] > 0.03]:
            near = np.linalg.norm(lower[:, :2] - at[:2], axis=1) < 0.01
            if near.any():
                gaps.append(at[2] - lower[near, 2].max())
        apart[keeps] = min(gaps)
    assert apart[True] > 0.002
    assert apart[False] < 0.0005
