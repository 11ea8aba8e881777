"""What a region's FEM works in: arrays that kernels write, of the sizes that its model asks for."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats, Ints
from softseam_services.halt import own_halt
from softseam_services.jit import record

from .kernels.contact_columns import N_COLUMNS
from .kernels.contact_tangents import BATCH, N
from .kernels.fronts import LANES
from .kernels.newton import N_MEMO
from .model import FemModel
from .parameters import FemParameters
from .tree import Factoring, scratch

MOST_AUGMENTATIONS = 4
"""times that a step is solved again where points are in deep"""
MEMORY = 12
"""columns of Anderson acceleration"""


@record
class Work(NamedTuple):
    """Scratch of one solver; nothing in it outlives a step but the factor, which `snapshot` drops, and a look at
    volumes, which goes by places alone."""

    part: Floats
    """how much of each cell `rule` or the fast path makes up (c,)"""
    full: Floats
    """how much of it `full` makes up (c,)"""
    mixed: Ints
    """how many cells `full` has a part of (1,)"""
    watched: NDArray[np.bool_]
    """cells that may lose volume between their points, see kernels/point_volumes.py (c,)"""
    watches: Ints
    """how many these are (1,)"""
    excess: Floats
    """the largest d of each cell, WATCHED where it is no more than that (c,)"""
    excess_at: Floats
    """places of the nodes that it is of (n, 3) [m]; NaN at first"""
    energy: Floats
    """of each cell (c,) [J]"""
    xe: Floats
    F: Floats
    P: Floats
    fe: Floats
    both: Floats
    """P and x of a cell that is cut, side by side (3, 24 + 27)"""
    h: Floats
    row: Floats
    ints: Ints
    values: Floats
    """the panels: matrix, then its factor"""
    factoring: Factoring
    memo: Floats
    """what is known of that factor, see kernels/newton.py (N_MEMO,)"""
    r: Floats
    d: Floats
    d_last: Floats
    dx: Floats
    basis: Floats
    """of GMRES; its halves are q and s of Anderson's method, which begins afresh after it"""
    hessenberg: Floats
    q: Floats
    s: Floats
    pair: Ints
    begun: Floats
    """per pair: where the point would be when the step ends, had it gone with the tool [m]"""
    offset: Floats
    """of the point from its anchor when the step begins, turned along with the tool [m]"""
    multiplier: Floats
    contact: Floats
    hold: Floats
    """per pair: stiffness [N/m], the part that is carried over, the gap that is left [m], the pace, and s of
    tools/kernels/patch.py [m]"""
    lean: Floats
    """per pair: where on its patch the force acts, in its edges from the middle (2,) [1]"""
    spread: Floats
    """per pair: eq. (3) of tools/kernels/patch.py (5,) [1]"""
    stored: Floats
    """what each point stores that yields to a tool (p, t) [J], see kernels/contact_work.py"""
    stored_x: Floats
    """with nodes there (n, 3) [m]"""
    stored_poses: Floats
    """and tools there (t, 7) [m], [1]"""
    side: NDArray[np.int8]
    """per pair: side of the box that the point faces, -1 where the tool's gap counts, SWEPT or EDGED"""
    plane: Floats
    """per pair: normal and distance of a plane in the tool's frame, where `side` says so (4,)"""
    state: NDArray[np.int8]
    factored_state: NDArray[np.int8]
    """contact states that the factor holds (p, t)"""
    factored: Floats
    """and their stiffness (p, t, 3, 3) [N/m]"""
    factored_patch: Floats
    """of those on patches: a vector b such that b b^T is what `factored` has along the normal, lean and spread
    (p, t, 10)"""
    gathered: Floats
    """see kernels/contact_tangents.py: weights of points of a cell (q 27,)"""
    gathered_block: Floats
    """their stiffness, six numbers each (q, 6) [N/m]"""
    gathered_scaled: Floats
    """weights times one of these (q 27,)"""
    gathered_product: Floats
    """what that makes of all pairs of nodes, six times (6 27 27,) [N/m]"""
    change: Floats
    """per pair: what the factor lacks of the whole tangent (3, 3) [N/m]"""
    turned: Ints
    """how many contacts closed, opened, stuck, slipped or turned round in the last evaluation (1,)"""
    gone: Ints
    """and how many that the factor has are open, and of these on patches under edges (2,)"""
    augmentations: Ints
    """how often the last step was solved again from the forces that it came to (1,)"""
    augmented_x: Floats
    """where it was solved before each (MOST_AUGMENTATIONS, n, 3) [m]"""
    augmented_force: Floats
    """and the multipliers that it was solved with after it (MOST_AUGMENTATIONS, p, t, 3) [N]"""
    x_hat: Floats
    inside: Floats
    """where internal forces are taken (n, 3) [m]"""
    force: Floats
    viscous: Floats
    """c of kernels/viscosity.py (1,)"""
    resistance: Floats
    """its T of each element (c, b, m, m) [N/m]"""
    origin: Floats
    """of each of its points F^-T at the start of the step (c, b q, 3, 3)"""
    volume: Floats
    """and det F there (c, b q)"""
    node_gap: Floats
    seam_block: Floats
    seam_coupled: Ints
    """1 where the other side's stiffness acts on the seam (1,)"""
    seam_impedance: Floats
    """(3s, 3s) [N/m]"""
    seam_target: Floats
    """(s, 3) [m]"""
    seam_away: Floats
    """anchor - x (3s, 1) [m]"""
    seam_actual: Floats
    """force on the seam nodes at the end of the step (s, 3) [N]"""
    material_state: Floats
    """what a material with state remembers at the start of the step, see kernels/points.py (c, 8, n)"""
    material_dt: Floats
    """length of that step (1,) [s]"""
    halt: Ints
    """not 0 where Newton's method shall return, solved or not, see softseam_services/halt.py (1,)"""


def build_work(model: FemModel, parameters: FemParameters, n_tools: int) -> Work:
    """Scratch arrays of the right sizes."""
    tree = model.tree
    n_cells, n_nodes = model.cell_nodes.shape[0], len(model.order)
    n_free = int(np.count_nonzero(tree.position >= 0))
    n_pairs = int(np.count_nonzero(parameters.point_stiffness)) * n_tools
    n_viscous = n_cells if parameters.retardation_time > 0.0 else 0
    n_elements, n_points, _, n_places = parameters.viscous.gradient.shape[1:]
    basis = np.zeros((2 * MEMORY, 3 * n_free))
    return Work(
        part=np.ones(n_cells),
        full=np.zeros(n_cells),
        mixed=np.zeros(1, dtype=np.int32),
        watched=np.zeros(n_cells, dtype=np.bool_),
        watches=np.zeros(1, dtype=np.int32),
        excess=np.zeros(n_cells),
        excess_at=np.full((n_nodes, 3), np.nan),
        energy=np.zeros(n_cells),
        xe=np.empty((n_cells, 3, 27)),
        F=np.empty((n_cells, 3, 24)),
        P=np.empty((n_cells, 3, 24)),
        fe=np.empty((n_cells, 3, 27)),
        both=np.empty((3, 51)),
        h=np.zeros(24 * LANES),
        row=np.zeros(9 * LANES),
        ints=np.zeros(8, dtype=np.int32),
        values=np.zeros(tree.n_values),
        factoring=scratch(tree),
        memo=np.zeros(N_MEMO),
        r=np.zeros(3 * n_free),
        d=np.zeros(3 * n_free),
        d_last=np.zeros(3 * n_free),
        dx=np.zeros(3 * n_free),
        basis=basis,
        hessenberg=np.zeros((len(basis), len(basis) + 2)),
        q=basis[:MEMORY],
        s=basis[MEMORY:],
        pair=np.zeros((n_pairs, 2), dtype=np.int32),
        begun=np.zeros((n_pairs, 3)),
        offset=np.zeros((n_pairs, 3)),
        multiplier=np.zeros((n_pairs, 3)),
        contact=np.zeros((n_pairs, N_COLUMNS)),
        hold=np.zeros((n_pairs, 5)),
        lean=np.zeros((n_pairs, 2)),
        spread=np.zeros((n_pairs, 5)),
        stored=np.zeros((len(model.point_face), n_tools)),
        stored_x=np.full((len(model.order), 3), np.nan),
        stored_poses=np.zeros((n_tools, 7)),
        side=np.zeros(n_pairs, dtype=np.int8),
        plane=np.zeros((n_pairs, 4)),
        state=np.zeros(n_pairs, dtype=np.int8),
        factored_state=np.zeros((len(model.point_face), n_tools), dtype=np.int8),
        factored=np.zeros((len(model.point_face), n_tools, 3, 3)),
        factored_patch=np.zeros((len(model.point_face), n_tools, 10)),
        gathered=np.zeros(BATCH * N),
        gathered_block=np.zeros((BATCH, 6)),
        gathered_scaled=np.zeros(BATCH * N),
        gathered_product=np.zeros(6 * N * N),
        change=np.zeros((n_pairs, 3, 3)),
        turned=np.zeros(1, dtype=np.int32),
        gone=np.zeros(2, dtype=np.int32),
        augmentations=np.zeros(1, dtype=np.int32),
        augmented_x=np.zeros((MOST_AUGMENTATIONS, n_nodes, 3)),
        augmented_force=np.zeros((MOST_AUGMENTATIONS, len(model.point_face), n_tools, 3)),
        x_hat=np.zeros((n_nodes, 3)),
        inside=np.zeros((n_nodes, 3)),
        force=np.zeros((n_nodes, 3)),
        viscous=np.zeros(1),
        resistance=np.zeros((n_viscous, n_elements, n_places, n_places)),
        origin=np.zeros((n_viscous, n_elements * n_points, 3, 3)),
        volume=np.zeros((n_viscous, n_elements * n_points)),
        node_gap=np.zeros(n_nodes),
        seam_block=np.empty((2, 9 * len(model.seam) ** 2)),
        seam_coupled=np.zeros(1, dtype=np.int32),
        seam_impedance=np.zeros((3 * len(model.seam), 3 * len(model.seam))),
        seam_target=np.zeros((len(model.seam), 3)),
        seam_away=np.zeros((3 * len(model.seam), 1)),
        seam_actual=np.zeros((len(model.seam), 3)),
        material_state=np.zeros((n_cells, 8, model.n_state)),
        material_dt=np.zeros(1),
        halt=own_halt(),
    )
