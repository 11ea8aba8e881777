"""A step that was solved is moved on by its linear answer to a force on the seam, without being solved again.

`ways` is what the probe of the seam's compliance found (`probe.probe_seam`): d(x, v)/d(force) of every probed node, and
of what lies beyond them, which goes along as one.
"""

from __future__ import annotations

from softseam_services.jit import njit

from .hanging import follow
from .summary import STRAIN, summarise_motion
from .sweep import batch_energies, strain_energy


@njit(cache=True, error_model="numpy")
def settle(ws, xw, blocks, nodes_of, figures, ids, beyond, ways, force, moved, x, v, result):
    """x, v (n, 3) += ways force; updated in place, as are positions in xw and energies in result (N_RESULTS,).

    ids     (k,)                 nodes that were probed
    beyond  (b,)                 nodes further away that are free
    ways    (3s, 2, k + 1, 3)    of x and v of each of `ids`, then of all `beyond` [m/N, m/s/N]
    force   (s, 3)               [N]
    moved   (2, k + 1, 3)        scratch
    """
    for place in range(moved.shape[1]):
        for c in range(3):
            moved[0, place, c] = moved[1, place, c] = 0.0
    for s in range(len(force)):
        for k in range(3):
            f, way = force[s, k], ways[3 * s + k]
            if f != 0.0:
                for which in range(2):
                    for place in range(moved.shape[1]):
                        for c in range(3):
                            moved[which, place, c] += f * way[which, place, c]
    for place in range(len(ids)):
        for c in range(3):
            x[ids[place], c] += moved[0, place, c]
            v[ids[place], c] += moved[1, place, c]
    last = len(ids)
    for place in range(len(beyond)):
        for c in range(3):
            x[beyond[place], c] += moved[0, last, c]
            v[beyond[place], c] += moved[1, last, c]
    follow(x, v, nodes_of.hanging)
    xw[: len(x), :3] = x
    batch_energies(ws, xw, blocks.nodes, blocks.volume, blocks.constants, blocks.law, 0, len(blocks.nodes), figures)
    summarise_motion(x, v, nodes_of.mass, nodes_of.x_rest, nodes_of.gravity, result)
    result[STRAIN] = strain_energy(figures)[0]
