"""What any solid does, whatever its law: momentum, energy, rigid motions, a uniform stress."""

import numpy as np

from softseam.conform.examined_part import (
    DENSITY,
    EDGE,
    ENDS,
    MASS,
    POISSON,
    REST,
    STEP,
    YOUNG,
    ExaminedPart,
    Service,
    expect,
    near,
    some_force,
)

_VOLUME = MASS / DENSITY
_CENTRE = REST.mean(axis=0)


def _turned(angle: float) -> np.ndarray:
    """R (3, 3) about an axis that is none of the cells'."""
    a = angle * np.array([1.0, 2.0, -2.0]) / 3.0
    cross = np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
    turned = np.eye(3) + np.sin(angle) / angle * cross + (1.0 - np.cos(angle)) / angle**2 * cross @ cross
    return np.asarray(turned)


def momentum(service: Service) -> None:
    """A free part: dt (weight + coupling forces) is the change of momentum."""
    gravity = (1.0, -2.0, -9.81)
    part, before, size = ExaminedPart(service, gravity=gravity), np.zeros(3), MASS * 9.81 * STEP
    for step in range(5):
        force = some_force(5e-3, step)
        reply = part.advance(step, 0, force)
        gained = STEP * (MASS * np.array(gravity) + force.sum(axis=0))
        near("momentum that changes by dt (weight + forces)", reply.momentum - before, gained, 1e-6 * size)
        before = reply.momentum


def angular(service: Service) -> None:
    """A free part that spins keeps its angular momentum to 1 % over ten steps."""
    spin = np.array([0.3, -0.5, 0.8])
    v = np.cross(spin, REST - _CENTRE)
    part = ExaminedPart(service, v=v)
    replies = [part.advance(step).angular_momentum for step in range(10)]
    size = float(np.abs(replies[0]).max())
    expect(size > 0.1 * MASS * EDGE**2 / 6.0, "angular momentum of a part that spins", f"{replies[0]}")
    near("the same angular momentum", replies[-1], replies[0], 0.01 * size)


def energy(service: Service) -> None:
    """Kinetic, strain and gravity's energy are those of the state; forces work by what the nodes move."""
    v, lift, stretch = np.array([0.1, 0.2, -0.1]), 0.01, 1e-3
    part = ExaminedPart(service, v=np.tile(v, (len(REST), 1)))
    kinetic = 0.5 * MASS * float(v @ v)
    near("kinetic energy of a part that flies", part.advance(0).kinetic, kinetic, 1e-3 * kinetic)
    part = ExaminedPart(service, gravity=(0.0, 0.0, -9.81), x=REST + np.array([0.0, 0.0, lift]))
    gained = MASS * 9.81 * lift
    near("gravity's energy of a part that was lifted", part.configured.gravity, gained, 1e-3 * gained)
    part = ExaminedPart(service, x=REST * (1.0 + stretch * np.array([1.0, -POISSON, -POISSON])))
    strain = 0.5 * YOUNG * stretch**2 * _VOLUME
    near("strain energy of a uniform stretch", part.configured.strain, strain, 0.02 * strain)
    part = ExaminedPart(service)
    force = some_force()
    reply = part.advance(0, 0, force)
    work = float((force * (reply.coupling.x - REST[part.coupling])).sum())
    near("work of the coupling forces", reply.coupling.work, work, 1e-3 * work)
    found = reply.kinetic + reply.strain
    expect(
        0.0 < found <= 1.01 * work, f"kinetic and strain energy of at most that work, {work:.3g} J", f"{found:.3g} J"
    )


def rigid(service: Service) -> None:
    """A part that was moved and turned rigidly (by 0.01, for linear solids) has no strain, and stays."""
    angle = 0.01
    x = (REST - _CENTRE) @ _turned(angle).T + _CENTRE + np.array([0.3, -0.2, 0.1])
    part = ExaminedPart(service, x=x)
    mistaken = 0.5 * YOUNG * angle**2 * _VOLUME
    expect(
        abs(part.configured.strain) <= 1e-3 * mistaken,
        f"no strain energy (below {1e-3 * mistaken:.2g} J) of a rigid motion",
        f"{part.configured.strain:.3g} J",
    )
    reply = part.advance(0)
    near("coupling nodes that stay where they are", reply.coupling.x, x[part.coupling], 1e-4 * angle * EDGE)


def uniform(service: Service) -> None:
    """Patch test: forces on both ends that hold a uniform stretch sum to E strain area, and nothing else moves."""
    stretch = 1e-3
    x = REST * (1.0 + stretch * np.array([1.0, -POISSON, -POISSON]))
    part = ExaminedPart(service, x=x, coupling=ENDS)
    free = part.advance(0).coupling.x
    n, push = 3 * len(ENDS), 1e-4
    moves = np.empty((n, n))
    for i in range(n):
        force = np.zeros(n)
        force[i] = push
        moves[:, i] = (part.advance(0, 1 + i, force.reshape(-1, 3)).coupling.x - free).ravel() / push
    held = np.linalg.lstsq(moves, (x[ENDS] - free).ravel(), rcond=None)[0].reshape(-1, 3)
    reply = part.advance(0, 1 + n, held)
    near("ends that are held", reply.coupling.x, x[ENDS], 0.01 * stretch * EDGE)
    wanted = YOUNG * stretch * EDGE**2
    right = REST[ENDS][:, 0] > 0.0
    near("a force of E strain area on one end", held[right].sum(axis=0), [wanted, 0.0, 0.0], 0.02 * wanted)
    near("and the opposite on the other", held[~right].sum(axis=0), [-wanted, 0.0, 0.0], 0.02 * wanted)
    near("a uniform stretch that stays", part.observe(1).x, x, 0.02 * stretch * EDGE)
