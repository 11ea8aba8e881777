# %% [markdown]
# # 6. Where it began: a flag over a ball, by the model of 1987
#
# Terzopoulos, Platt, Barr and Fleischer (*Elastically deformable models*, SIGGRAPH 1987, doi 10.1145/37401.37427) gave
# graphics its first sheets that obey mechanics. The point a = (a1, a2) of a sheet is at r(a), n is its normal there.
# G_ij = dr/da_i . dr/da_j is the metric tensor (lengths and angles), B_ij = n . d2r/da_i da_j the curvature tensor. The
# elastic energy is how far both are from those at rest: squared, weighted, integrated once over the sheet.
#
#     E(r) = integral of  sum_ij eta_ij (G_ij - G0_ij)^2 + xi_ij (B_ij - B0_ij)^2  da1 da2                        (1)
#     mu r'' + gamma r' + dE/dr = f,   mu: mass per area, gamma: drag                                             (2)
#
# The textbook's chapter (9.7.2) has alpha |eps|^2 + beta |laplace r|^2 in place of it, integrates that twice, and takes
# the strain eps of small displacements, which sees stretch in a sheet that only turns.

# %%
import sys
import time

import matplotlib.pyplot as plt
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

import softseam
from softseam import Scene

N, SIZE, BALL = 20, 0.4, 0.1  # spacings; edge and radius [m]
STRETCH, SHEAR, BENDING = 60.0, 22.5, 1e-4  # [N/m], [N/m], [N m]
DENSITY, DRAG, GRAVITY, STEP, DURATION = 0.2, 3.0, 9.81, 0.01, 1.0  # [kg/m^2], [1/s], [m/s^2], [s], [s]
KEEP = 0.375 * SIZE / N  # what the sheet keeps from tools [m]
TOP = BALL + KEEP
SHEET = {
    "kind": "sheet",
    "size": [SIZE, SIZE],
    "divisions": [N, N],
    "density": DENSITY,
    "stretch": STRETCH,
    "shear": SHEAR,
    "bending": BENDING,
    "position": [0, 0, TOP],
    "damping": DRAG,
    "fixed": [{"min": [-KEEP, -KEEP, 0], "max": [KEEP, KEEP, 1]}],
}
SCENE = {
    "softseam": 1,
    "name": "flag",
    "gravity": [0, 0, -GRAVITY],
    "step": STEP,
    "duration": DURATION,
    "body": SHEET,
    "tools": {"ball": {"kind": "sphere", "radius": BALL, "position": [0, 0, 0], "friction": 0}},
    "quantities": ["stretch_energy", "bending_energy"],
}

# %% [markdown]
# On a lattice, as in the paper, derivatives are differences: a matrix for each takes all points r (n, 3) to its value
# at every sample. Lengths are sampled on edges, bends at points, angles and twists in cells.

# %%
h = SIZE / N
here = sparse.identity(N + 1, format="csr")
first = sparse.diags([-1.0, 1.0], [0, 1], shape=(N, N + 1)) / h
middle = sparse.diags([0.5, 0.5], [0, 1], shape=(N, N + 1))
second = sparse.diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(N - 1, N + 1)) / h**2
slope = sparse.csr_matrix(np.gradient(np.eye(N + 1), h, axis=0))
share = np.r_[0.5, np.ones(N - 1), 0.5]  # of a spacing that a line of points stands for
cells = np.full(N * N, h**2)
edges = h**2 * np.kron(share, np.ones(N)), h**2 * np.kron(np.ones(N), share)
bends = h**2 * np.kron(share, np.ones(N - 1)), h**2 * np.kron(np.ones(N - 1), share)
in_cells = sparse.kron(middle, first), sparse.kron(first, middle)


def stacked(*matrices: sparse.spmatrix) -> sparse.csr_matrix:
    return sparse.vstack(matrices, format="csr")


along = sparse.kron(here, first), sparse.kron(first, here)  # dr/da1 and dr/da2 on edges
METRIC = stacked(*along, in_cells[0]), stacked(*along, in_cells[1])  # G = u . v of these
G_REST = np.r_[np.ones(2 * len(edges[0])), np.zeros(N * N)]
ETA = np.r_[STRETCH / 8 * edges[0], STRETCH / 8 * edges[1], SHEAR / 2 * cells]  # G12 and G21 are one sample
CURVATURE = (  # B = n . w, n the normal of u and v
    stacked(sparse.kron(here, slope[1:-1]), sparse.kron(here[1:-1], slope), in_cells[0]),
    stacked(sparse.kron(slope, here[1:-1]), sparse.kron(slope[1:-1], here), in_cells[1]),
    stacked(sparse.kron(here, second), sparse.kron(second, here), sparse.kron(first, first)),
)
XI = np.r_[BENDING / 2 * bends[0], BENDING / 2 * bends[1], BENDING * cells]
WEIGHT = np.r_[ETA, XI]

# %% [markdown]
# The weights are the product's moduli: eta = Y/8 and G/4, as the strain of an edge is (G_11 - 1)/2 and that of an angle
# G_12, and xi = D/2. A metric sample changes by u . dv + v . du. A curvature sample, with l = |u x v| and p what of w
# lies in the sheet, by
#
#     d(n . w) = n . dw + (v x p)/l . du + (p x u)/l . dv                                                         (3)
#
# (from dn = (1 - n n^T)(du x v + u x dv)/l): the rows of the Jacobian J of all deviations c, with dE/dr = 2 J^T W c.


# %%
def jacobian(matrices: tuple, slopes: tuple) -> sparse.csr_matrix:
    """Sum of diag(slope) matrix over the matrices, for x, y and z side by side."""
    axes = [sum(sparse.diags(by[:, k]) @ of for of, by in zip(matrices, slopes, strict=True)) for k in range(3)]
    return sparse.hstack(axes, format="csr")


def deviations(r: np.ndarray) -> np.ndarray:
    """c: metric and curvature of every sample, less those at rest."""
    u, v = (of @ r for of in METRIC)
    a, b, w = (of @ r for of in CURVATURE)
    normal = np.cross(a, b)
    curvature = (normal * w).sum(axis=1) / np.linalg.norm(normal, axis=1)
    return np.r_[(u * v).sum(axis=1) - G_REST, curvature]


def slopes(r: np.ndarray) -> sparse.csr_matrix:
    """J by eq. (3)."""
    u, v = (of @ r for of in METRIC)
    a, b, w = (of @ r for of in CURVATURE)
    normal = np.cross(a, b)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal /= length
    p = w - (normal * w).sum(axis=1, keepdims=True) * normal
    bent = jacobian(CURVATURE, (np.cross(b, p) / length, np.cross(p, a) / length, normal))
    return stacked(jacobian(METRIC, (v, u)), bent)


def energy(r: np.ndarray) -> float:
    """E of eq. (1) [J]."""
    return float(WEIGHT @ deviations(r) ** 2)


def gradient(r: np.ndarray) -> np.ndarray:
    """dE/dr (n, 3) [N]."""
    return (slopes(r).T @ (2.0 * WEIGHT * deviations(r))).reshape(3, -1).T


# %% [markdown]
# Is that the gradient of (1)? Differences along a random way say so, on a crumpled sheet. A turn costs nothing. A
# shallow saddle z = k (x^2 - y^2)/2 costs D k^2 an area, on the rows that have a bend; laplace r is zero there, so that
# the chapter's energy lets a sheet become a saddle for nothing.

# %%
random = np.random.default_rng(0)
side = np.linspace(-0.5, 0.5, N + 1) * SIZE
r0 = np.stack([*(a.ravel() for a in np.meshgrid(side, side)), np.full((N + 1) ** 2, TOP)], axis=1)
crumpled = r0 + 0.2 * h * random.standard_normal(r0.shape)
way, tiny = random.standard_normal(r0.shape), 1e-6 * h
difference = (energy(crumpled + tiny * way) - energy(crumpled - tiny * way)) / (2.0 * tiny)
off = abs((gradient(crumpled) * way).sum() / difference - 1.0)
turn, _ = np.linalg.qr(random.standard_normal((3, 3)))
turned = energy(r0 @ turn.T) / energy(crumpled)
k = 0.001
saddle = r0 + np.outer(0.5 * k * (r0[:, 0] ** 2 - r0[:, 1] ** 2), [0, 0, 1])
bent = energy(saddle) / (BENDING * k**2 * SIZE**2 * (N - 1) / N)
print(f"the gradient is off the energy's differences by {off:.0e}; a turn costs {turned:.0e} of what crumpling does")
print(f"a saddle has {bent:.5f} of its closed form")
assert off < 1e-7 and turned < 1e-20
assert abs(bent - 1.0) < 1e-3, "the rest is stretch, which is small as k^4"

# %% [markdown]
# Now (2), by implicit Euler with one linear solve a step: the force at its end is that at its start and the change of
# it, of which 2 J^T W J is the part that is never negative. The middle is pinned to the top of the ball, which pushes
# points out by stiff springs. Beside it the product's sheet: springs and bends of the same moduli, swept by XPBD.

# %%
PUSH = 200.0  # of a point [N/m]
mass = DENSITY * h**2 * np.kron(share, share)
free = np.arange(len(mass)) != len(mass) // 2


def after(r: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Where the sheet is a step later (n, 3) [m]."""
    rows, distance = slopes(r), np.linalg.norm(r, axis=1, keepdims=True)
    outward = r / distance
    gap = distance[:, 0] - TOP
    push = np.where(gap + STEP * (outward * v).sum(axis=1) < 0.0, PUSH, 0.0)
    contact = [[sparse.diags(push * outward[:, i] * outward[:, j]) for j in range(3)] for i in range(3)]
    inertia = sparse.diags(np.tile(mass * (1.0 / STEP + DRAG) / STEP, 3))
    force = mass[:, None] * (v / STEP - [0, 0, GRAVITY]) - (push * gap)[:, None] * outward - gradient(r)
    matrix = (inertia + 2.0 * rows.T @ sparse.diags(WEIGHT) @ rows + sparse.block_array(contact)).tocsr()
    moving, change = np.tile(free, 3), np.zeros(3 * len(mass))
    factor = splu(matrix[moving][:, moving].tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    change[moving] = factor.solve(force.T.ravel()[moving])
    return r + change.reshape(3, -1).T


began = time.perf_counter()
then, v = r0, np.zeros_like(r0)
for _ in range(round(DURATION / STEP)):
    following = after(then, v)
    then, v = following, (following - then) / STEP
took_1987 = time.perf_counter() - began
with softseam.open(Scene.model_validate(SCENE)) as sim:
    sim.reset()
    began = time.perf_counter()
    today = sim.step(count=round(DURATION / STEP)).positions
    took_today = time.perf_counter() - began

# %%
figure = plt.figure(figsize=(11, 5))
longitude, latitude = np.meshgrid(np.linspace(0, 2 * np.pi, 40), np.linspace(0, np.pi, 20))
ball = BALL * np.stack([np.sin(latitude) * np.cos(longitude), np.sin(latitude) * np.sin(longitude), np.cos(latitude)])
for number, (title, r) in enumerate(
    {"1987: metric and curvature": then, "today: springs and bends, XPBD": today}.items()
):
    axes = figure.add_subplot(1, 2, number + 1, projection="3d")
    axes.plot_surface(*ball, color="0.6", shade=True)
    axes.plot_surface(*(r[:, i].reshape(N + 1, N + 1) for i in range(3)), color="tab:red", edgecolor="k", linewidth=0.3)
    axes.view_init(elev=18, azim=-65)
    axes.set(xlim=(-0.16, 0.16), ylim=(-0.16, 0.16), zlim=(-0.13, 0.12))
    axes.set_box_aspect((0.32, 0.32, 0.25), zoom=1.3)
    axes.set_axis_off()
    axes.set_title(title)
plt.savefig(sys.argv[1] if len(sys.argv) > 1 else "terzopoulos.png", dpi=120, bbox_inches="tight")

# %% [markdown]
# The same since 1987: lengths, angles and bends on a lattice, each with an energy and a weight; a drag; mass in points.
# What changed: springs replace the metric, so that Poisson's ratio is 1/3 in place of 0. Bends take the whole second
# difference in place of its part along n: their forces are linear in r, and no normal is needed. XPBD sweeps many short
# substeps without a matrix, where this takes one sparse factor a step. Layers keep apart, contact is met and may have
# friction. Try `STEP = 0.005`, and `BENDING = 2e-5`, by which the sheet has more ways to fold than one.

# %%
corners = [0, N, -N - 1, -1]
low = [1e3 * float(r[corners, 2].mean()) for r in (then, today)]
ratio = energy(today) / energy(then)
print(f"corners hang at {low[0]:.0f} and {low[1]:.0f} mm; today's sheet has {ratio:.2f} times the energy (1) of 1987's")
print(f"a second of both took {took_1987:.1f} s with a matrix and {took_today:.2f} s with sweeps")
assert abs(low[0] - low[1]) < 1e3 * 0.03 * SIZE, "both hang alike"
assert 0.7 < ratio < 1.4, "and are strained alike"
