"""What FEM says of a squeeze, as a formula: runs are made beforehand, and what comes between is interpolated."""

from softseam_studies.surrogate.surrogate import Surrogate, Told

__all__ = ["Surrogate", "Told"]
