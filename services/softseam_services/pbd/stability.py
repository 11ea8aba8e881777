"""How long a substep of PBD may be, and how much its blocks count with of what their nodes give way."""

import numpy as np

KAPPA = 0.5
"""share of the largest local compliance that the local solve counts with; 0.5 to 0.6 gave the longest stable substeps
on Simpson masses, where the nodes of a block differ by up to 8"""
STABLE = ((0.0, 0.2, 0.3, 0.4, 0.45), (0.9, 1.3, 1.75, 2.1, 2.6))
"""largest omega_max h with one sweep against Poisson's ratio; measured by undamped random kicks, see the decision note.
An explicit step has 2."""
TOUCHED = ((0.0, 0.2, 0.3, 0.4, 0.45, 0.49), (0.9, 1.0, 1.3, 1.8, 2.0, 2.1))
"""the same where tools may touch: beyond, blocks between smooth walls gain energy (decision 22), points chatter and
friction holds less than it should (decision 22)"""
TWO_SWEEPS = 1.5
"""how much longer a substep may be with two sweeps and more"""
SHORTER, LONG = 2.0, 25.0
"""how many times shorter substeps are where stress is viscous, and the damping time up to which that is enough, in
longest undamped substeps; beyond it grows with the time's root (decision 24)"""
SHOWN = 0.8
"""what slow modes lag by, of what blocks do whose nodes do not give way: 0.55 to 1.16 on 23 bodies (decision 24)"""
EXPLICIT = 1.5
"""omega_max h that leapfrog takes; squeezed blocks swing faster than at rest: kicked at random, from 1.7 on some bodies
gain energy"""
EXPLICIT_LIMIT = 2.0
"""omega_max h from which on leapfrog is unstable"""


def shorter_by(rate: float, time: float) -> float:
    """How many times shorter than without it substeps are where stress is damped by `time` [s].

    rate: one over the longest substep without [1/s]
    """
    times = rate * time
    return max(1.0, min(2.0 * times, SHORTER * float(np.sqrt(max(1.0, times / LONG)))))
