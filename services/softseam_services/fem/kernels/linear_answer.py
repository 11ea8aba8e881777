"""A step that was solved is moved on by its linear answer to a force on the seam, without being solved again.

With A = M/dt^2 + K the matrix of the step's last iteration, contacts and the other side's stiffness included,

    A dx = L^T f,   x += dx,   v += dx/dt                                                                    (1)

for implicit Euler, where v = (x - x0)/dt. On a free body the sum of M dv is dt times the sum of f: momentum is exact.
Anchors of points that stick stay where they are (kernels/contact.py), so that the next step knows of dx. Points that a
factor was made to take as touching, as they were near a tool, and that do not touch, are held in (1) all the same.
"""

from softseam_services.jit import njit

from .fronts import solve_seam


@njit(cache=True, error_model="numpy")
def move_on(model, tree, work, force, dt, x, v):
    """x and v (n, 3) <- eq. (1) for f = force (s, 3) [N], with the factor at hand; updated in place."""
    step = work.d
    step[:] = 0.0
    for s in range(len(model.seam)):
        place = 3 * model.order[model.seam[s]]
        for i in range(3):
            step[place + i] += force[s, i]
    solve_seam(tree, work.values, step, work.factoring)
    for node in range(len(model.order)):
        place = 3 * model.order[node]
        if place >= 0:
            for i in range(3):
                x[node, i] += step[place + i]
                v[node, i] += step[place + i] / dt
