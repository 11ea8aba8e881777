"""Contact forces that were handed over with one tool a point, shared out among all tools that the point touches."""

from softseam_services.jit import njit
from softseam_services.tools.kernels import tool_gap


@njit(cache=True, error_model="numpy")
def split_forces(kind, shape, position, orientation, point_x, touches, near_gap, force):
    """Share out the force of points that touch several tools but were handed over with one: force updated in place.

    Any shares with the same sum that lie in the friction cones balance as well. Here a further tool takes the part
    along its normal, as far as that pushes, and the first one keeps the rest. Points of coarse cells have forces of
    their neighbours as well, tool by tool (`points.hand_on`): the largest is shared out, the others gain or stay.

    near_gap       a tool that is closer than this touches [m]
    force (p, t, 3)  [N]
    """
    for point in range(len(point_x)):
        first, most = -1, 0.0
        for tool in range(len(kind)):
            size = force[point, tool, 0] ** 2 + force[point, tool, 1] ** 2 + force[point, tool, 2] ** 2
            if size > most:
                first, most = tool, size
        if first < 0:
            continue
        f = force[point, first]
        for tool in range(len(kind)):
            if tool == first or not touches[point, tool]:
                continue
            gap, nx, ny, nz = tool_gap(kind[tool], shape[tool], position[tool], orientation[tool], point_x[point])
            push = f[0] * nx + f[1] * ny + f[2] * nz
            _, mx, my, mz = tool_gap(kind[first], shape[first], position[first], orientation[first], point_x[point])
            # Only the part that the first tool does not push itself.
            push -= max(0.0, f[0] * mx + f[1] * my + f[2] * mz) * max(0.0, nx * mx + ny * my + nz * mz)
            if gap < near_gap and push > 0.0:
                force[point, tool, 0] += push * nx
                force[point, tool, 1] += push * ny
                force[point, tool, 2] += push * nz
                f[0] -= push * nx
                f[1] -= push * ny
                f[2] -= push * nz
