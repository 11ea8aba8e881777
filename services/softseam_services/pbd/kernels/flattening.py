"""How firmly a sampled point presses on a face where one of the surfaces is round and runs through cells.

Each of the two yields under a pressure p as under a tool (eq. (1) of tools/kernels/patch.py), by where on its octants'
faces it is pressed (body/bulges.py), and both feel the same p:

    d(p) = sum over both of y p + (1 - q) s p/(p + q s/y)                                                           (1)

with y and q = LIGHT/r of each, s of the point and of its foot on the other. Together they take up how much they are
round against one another, each a share of it that is as 1/E: s is 8 SAG times that of what `bulges.Lattice` has stand
out there. p(d) is convex, so it is a sum of hinges, each with a stiffness of its own from a depth of its own on:
straight between the pressures by which the second part of d has come by a quarter, a half and three quarters of what it
comes to, and as steep as without s from there on. So a patch of such points bends only more often, and stays the slope
of an energy. With ten hinges for four forces of balls are .3 to .5 % less.
"""

import numpy as np

from softseam_services.jit import njit
from softseam_services.tools.kernels import SAG

from .lanes import three
from .sampled_points import LEAST
from .touch import CORNER, FADE, POINT, SHARE, SIDE

HINGES = 4
"""of a point at most"""


@njit(cache=True, error_model="numpy", forceinline=True)
def _stands_out(octant, rise, spread, mean):
    """How far what is at a place of `bulges.Lattice` does, where what touches it is so round [m]."""
    out = 0.0
    for c in range(3):
        f = octant[c] - np.floor(octant[c])
        out += (rise[c] + mean * spread[c]) * 4.0 * f * (1.0 - f)
    return max(0.0, out)


@njit(cache=True, error_model="numpy", forceinline=True)
def _between(values, corners, share):
    """values (p, 3) at a foot between points."""
    a, b, c = three(values, corners[0]), three(values, corners[1]), three(values, corners[2])
    u, v, w = share
    return u * a[0] + v * b[0] + w * c[0], u * a[1] + v * b[1] + w * c[1], u * a[2] + v * b[2] + w * c[2]


@njit(cache=True, error_model="numpy", forceinline=True)
def _lags(sag, yields, light, pressure):
    """The second part of eq. (1), of one side, where p > 0 [m]."""
    return (1.0 - light) * sag * pressure / (pressure + light * sag / yields)


@njit(cache=True, error_model="numpy")
def find_hinges(touch, meeting, ints, row, depth, stiff):
    """Depths of a row [m] from which stiffnesses [Pa/m] count, in the first places of depth and stiff (HINGES,).

    Returns how many these are: one, without s, of a point that will hardly press in this step.
    """
    side = ints[SIDE] % 2
    one, other = touch.sides[meeting, side], touch.sides[meeting, 1 - side]
    mine, theirs = touch.yields[one], touch.yields[other]
    both = mine + theirs
    depth[0], stiff[0] = 0.0, 1.0 / both
    if row[FADE] <= LEAST or not (touch.curved[one] or touch.curved[other]):
        return 1
    point, at = touch.first[one] + ints[POINT], touch.first[other]
    corners = at + ints[CORNER], at + ints[CORNER + 1], at + ints[CORNER + 2]
    share = row[SHARE], row[SHARE + 1], row[SHARE + 2]
    turns = share[0] * touch.mean[corners[0]] + share[1] * touch.mean[corners[1]] + share[2] * touch.mean[corners[2]]
    own = _stands_out(three(touch.octant, point), three(touch.rise, point), three(touch.spread, point), turns)
    foot = _between(touch.octant, corners, share), _between(touch.rise, corners, share)
    their = _stands_out(foot[0], foot[1], _between(touch.spread, corners, share), touch.mean[point])
    if own + their == 0.0:
        return 1
    light, their_light = touch.light[one], touch.light[other]
    soft, their_soft = mine / (light * touch.spacing[one]), theirs / (their_light * touch.spacing[other])  # as 1/E
    own *= 8.0 * SAG * soft / (soft + their_soft)
    their *= 8.0 * SAG * their_soft / (soft + their_soft)
    scale = (light * own + their_light * their) / both
    pressure_before = depth_before = slope_before = 0.0
    for hinge in range(HINGES):
        slope, pressure, inside = 1.0 / both, 0.0, 0.0
        if hinge + 1 < HINGES:
            pressure = scale * (hinge + 1) / (HINGES - 1 - hinge)
            inside = both * pressure
            inside += _lags(own, mine, light, pressure) + _lags(their, theirs, their_light, pressure)
            slope = (pressure - pressure_before) / (inside - depth_before)
        depth[hinge], stiff[hinge] = depth_before, slope - slope_before
        pressure_before, depth_before, slope_before = pressure, inside, slope
    return HINGES
