"""What a step of FEM or of XPBD takes, roughly, by its cells: enough to put runs in order before any was made."""


def fem_step(n_cells: float) -> float:
    """Rough wall time of a step of FEM [s]."""
    return float(2e-4 + 4e-6 * n_cells**1.55)


def xpbd_step(n_cells: float, step: float) -> float:
    """Rough wall time of a step of XPBD of that length [s]."""
    return float(2e-4 + 2.5e-6 * n_cells ** (4 / 3) * step / 0.01)
