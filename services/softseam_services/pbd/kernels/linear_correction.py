"""A step that was solved is moved on by its linear answer to a force on the seam, without being solved again.

`ways` is what the probe of the seam's compliance found (`probe.probe_seam`): d(x, v)/d(force) of every probed node, and
of what lies beyond them, which goes along as one.
"""

from softseam_services.jit import njit

from .hanging import follow
from .summary import STRAIN, summarise_motion
from .sweep import batch_energies, strain_energy


@njit(cache=True, error_model="numpy")
def correct_linearly(model, parameters, state, force, ids, beyond, ways, moved, scratch, result, ws):
    """x, v (n, 3) of the state += ways force; updated in place, as are positions in scratch.xw and energies in result
    (N_RESULTS,).

    force   (s, 3)               [N]
    ids     (k,)                 nodes that were probed
    beyond  (b,)                 nodes further away that are free
    ways    (3s, 2, k + 1, 3)    of x and v of each of `ids`, then of all `beyond` [m/N, m/s/N]
    moved   (2, k + 1, 3)        scratch
    """
    x, v, xw = state.x, state.v, scratch.xw
    row, rows = moved.reshape(-1), ways.reshape(len(ways), -1)  # flat, the sum below is one of long vectors
    row[:] = 0.0
    for s in range(len(force)):
        for k in range(3):
            f = force[s, k]
            if f != 0.0:
                for entry in range(len(row)):
                    row[entry] += f * rows[3 * s + k, entry]
    for place in range(len(ids)):
        for c in range(3):
            x[ids[place], c] += moved[0, place, c]
            v[ids[place], c] += moved[1, place, c]
    last = len(ids)
    for place in range(len(beyond)):
        for c in range(3):
            x[beyond[place], c] += moved[0, last, c]
            v[beyond[place], c] += moved[1, last, c]
    follow(x, v, model.hanging)
    xw[: len(x), :3] = x
    n_batches = len(model.blocks)
    batch_energies(
        *(ws, xw, model.blocks, parameters.volume, parameters.constants, parameters.law, 0, n_batches, scratch.figures),
    )
    summarise_motion(parameters, x, v, result)
    result[STRAIN] = strain_energy(scratch.figures)[0]
