"""What can be wrong with a body's shape, and with settings on this body."""


class MeshError(ValueError):
    """A shape that cannot be simulated. The text names the file, the counts, the worst element and the remedy."""


class RowError(ValueError):
    """A row of a table, a law, shape or constraint, that cannot be used. The text says why."""


class LawError(RowError):
    """A material law that cannot be used."""


class ShapeError(RowError):
    """A shape that cannot be used."""


class ConstraintError(RowError):
    """A constraint of particles that cannot be used."""


class SettingError(ValueError):
    """A setting that this body cannot be simulated with. The text begins with its key and names the remedy."""


class ToolError(ValueError):
    """A tool that cannot be used. The text names the tool and the remedy."""
