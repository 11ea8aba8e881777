"""What users add to softseam's tables: modules named by SOFTSEAM_EXTENSIONS, imported by every process at start.

An extension is a Python module that adds rows to tables as it is imported. In a program of one process an `import` is
all that it takes. Services are processes of their own: they import the modules that the environment variable names,
separated by commas, before they read their first scene.
"""

import os
from importlib import import_module

VARIABLE = "SOFTSEAM_EXTENSIONS"


class ExtensionError(RuntimeError):
    """An extension could not be imported; the text names it and says why."""


def load_extensions() -> tuple[str, ...]:
    """Import the modules that SOFTSEAM_EXTENSIONS names, each once; their names. Raises ExtensionError."""
    names = tuple(name for part in os.environ.get(VARIABLE, "").split(",") if (name := part.strip()))
    for name in names:
        try:
            import_module(name)
        except Exception as error:
            raise ExtensionError(
                f"{VARIABLE} names {name!r}, which cannot be imported ({type(error).__name__}: {error}): put it on "
                "PYTHONPATH, or take its name out"
            ) from error
    return names
