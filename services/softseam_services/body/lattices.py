"""Sheets and ropes: springs and bends between particles, as stiff as the continuum that the scene describes.

sheet   A lattice of spacings a, b (diagonal L) with springs along x, y and both diagonals. A strain (e_x, e_y, g)
        gives a diagonal the strain (a^2 e_x + b^2 e_y +- a b g)/L^2, so the energy per area, 1/2 [k_x a/b e_x^2 + k_y
        b/a e_y^2] + k_d/(a b L^2) [(a^2 e_x + b^2 e_y)^2 + a^2 b^2 g^2], is that of a membrane with C66 = C12 = G and
        C11 = C22 if
            k_d = G L^2/(2 a b),    k_x = (C11 - G a^2/b^2) b/a,    k_y = (C11 - G b^2/a^2) a/b.               (1)
        C12 = C66 is Cauchy's relation: springs cannot choose Poisson's ratio. Y = C11 - C12^2/C11 is what pulling a
        strip shows; G = 3/8 Y makes the sheet isotropic with Poisson's ratio 1/3. Springs on the border count half.
        Bending: D/2 (w_xx^2 + w_yy^2 + 2 w_xy^2) per area, an isotropic plate with Poisson's ratio 0: three particles
        in a row have the second difference a^2 w_xx and the stiffness D b/a^3, four around a cell a b w_xy and 2 D/(a
        b). (2)
rope    EA/a along it, and E I/a^3 for the second difference of three particles in a row.                            (3)

A bend is the vector sum_i c_i x_i with energy 1/2 k |sum_i c_i x_i|^2: quadratic, so it does not break where the sheet
is flat, and blind to stretch only as far as the sheet does not stretch (Bergou et al. 2006, "A quadratic bending model
for inextensible surfaces"; on a lattice their hinges become these differences).
"""

import numpy as np

from softseam_protocol.scene.particles import RopeBody, SheetBody
from softseam_protocol.scene.scene import Scene
from softseam_services.body.body import Floats, Ints
from softseam_services.body.particles import ParticleBody, assemble, bends_of, placed, springs_of
from softseam_services.body.skin import rope_skin, sheet_skin


def build_sheet(scene: Scene, spec: SheetBody) -> ParticleBody:
    """The sheet of a scene; the same scene gives the same bits in every process."""
    (nx, ny), size = spec.divisions, np.array(spec.size)
    a, b = (size / spec.divisions).tolist()
    number = np.arange((nx + 1) * (ny + 1), dtype=np.int32).reshape(ny + 1, nx + 1)
    at = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, nx + 1), np.linspace(-0.5, 0.5, ny + 1)), axis=-1).reshape(-1, 2)
    x_rest = placed(spec, np.concatenate([at * size, np.zeros((len(at), 1))], axis=1))
    shares = line_shares(ny)[:, None] * line_shares(nx)[None, :]
    shear = 0.375 * spec.stretch if spec.shear is None else spec.shear
    c11 = spec.axial(shear)
    k_x, k_y = (c11 - shear * (a / b) ** 2) * b / a, (c11 - shear * (b / a) ** 2) * a / b  # eq. (1)
    k_d = shear * (a * a + b * b) / (2.0 * a * b)
    along_x = np.stack([number[:, :-1], number[:, 1:]], axis=-1)
    along_y = np.stack([number[:-1], number[1:]], axis=-1)
    up = np.stack([number[:-1, :-1], number[1:, 1:]], axis=-1).reshape(-1, 2)
    down = np.stack([number[:-1, 1:], number[1:, :-1]], axis=-1).reshape(-1, 2)
    stiffness = [
        np.repeat(k_x * line_shares(ny), nx),
        np.tile(k_y * line_shares(nx), ny),
        np.full(2 * nx * ny, k_d),
    ]
    nodes = np.concatenate([along_x.reshape(-1, 2), along_y.reshape(-1, 2), up, down])
    d = spec.bending
    bends = [
        (_rows(number), np.array([1.0, -2.0, 1.0, 0.0]), np.repeat(d * b / a**3 * line_shares(ny), max(nx - 1, 0))),
        (_rows(number.T), np.array([1.0, -2.0, 1.0, 0.0]), np.repeat(d * a / b**3 * line_shares(nx), max(ny - 1, 0))),
        (
            np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]], axis=-1).reshape(-1, 4),
            np.array([1.0, -1.0, -1.0, 1.0]),
            np.full(nx * ny, 2.0 * d / (a * b)),
        ),
    ]
    radius = 0.5 * (0.75 * min(a, b) if spec.thickness is None else spec.thickness)
    if spec.thickness is None and spec.self_contact:
        radius = max(radius, 0.375 * max(a, b))
    return assemble(
        scene,
        spec,
        x_rest=x_rest,
        mass=(spec.density * a * b * shares).ravel(),
        springs=springs_of(x_rest, nodes, np.concatenate(stiffness)),
        bends=bends_of(bends),
        skin=sheet_skin(nx, ny, radius),
        spacing=min(a, b),
        reach=float(size.max()),
        radius=radius,
        self_contact=spec.self_contact,
        self_friction=spec.friction,
    )


def build_rope(scene: Scene, spec: RopeBody) -> ParticleBody:
    """The rope of a scene; the same scene gives the same bits in every process."""
    n = spec.divisions
    a = spec.length / n
    number = np.arange(n + 1, dtype=np.int32)
    x_rest = np.zeros((n + 1, 3))
    x_rest[:, 0] = np.linspace(-0.5, 0.5, n + 1) * spec.length
    x_rest = placed(spec, x_rest)
    nodes = np.stack([number[:-1], number[1:]], axis=1)
    bends = [(_rows(number[None]), np.array([1.0, -2.0, 1.0, 0.0]), np.full(max(n - 1, 0), spec.bending / a**3))]
    radius = 0.25 * a if spec.radius is None else spec.radius
    return assemble(
        scene,
        spec,
        x_rest=x_rest,
        mass=spec.density * a * line_shares(n),
        springs=springs_of(x_rest, nodes, np.full(n, spec.stretch / a)),
        bends=bends_of(bends),
        skin=rope_skin(n + 1, radius),
        spacing=a,
        reach=spec.length,
        radius=radius,
        self_contact=False,
        self_friction=0.0,
    )


def _rows(number: Ints) -> Ints:
    """Three neighbours along the last axis, and the first once more (m, 4)."""
    left, middle, right = number[:, :-2], number[:, 1:-1], number[:, 2:]
    return np.stack([left, middle, right, left], axis=-1).reshape(-1, 4)


def line_shares(n: int) -> Floats:
    """Spacings that each of n + 1 points on a line stands for (n + 1,)."""
    shares = np.ones(n + 1)
    shares[[0, -1]] = 0.5
    return shares
