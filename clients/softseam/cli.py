"""The command line: an error is one message, and exit code 1 or 2. The commands are those of `app`."""

import os
import sys

from rich.console import Console
from rich.markup import escape

from softseam.errors import BadInput, MissingExtra, NoConnection, SceneRefused, ServicesFailed, SoftseamError
from softseam_protocol.extensions import ExtensionError, load_extensions
from softseam_protocol.scene.scene import SeveralBodies

OK, FAILED, BAD_INPUT = 0, 1, 2
EXIT_CODES = {
    ExtensionError: BAD_INPUT,
    SeveralBodies: BAD_INPUT,
    SoftseamError: FAILED,
    ServicesFailed: FAILED,
    SceneRefused: BAD_INPUT,
    BadInput: BAD_INPUT,
    MissingExtra: BAD_INPUT,
    NoConnection: BAD_INPUT,
}
"""of an error: that of the nearest of its classes; what was refused before it began is bad input"""


def main() -> int:
    """Entry point: turns every error into one message and an exit code."""
    error_console = Console(stderr=True)
    try:
        load_extensions()
        from softseam.app import app  # which takes its choices from the tables

        app()
        return OK
    except tuple(EXIT_CODES) as error:
        error_console.print(f"[bold red]error:[/bold red] {escape(str(error))}", highlight=False, soft_wrap=True)
        return next(EXIT_CODES[kind] for kind in type(error).__mro__ if kind in EXIT_CODES)
    except BrokenPipeError:
        # whoever read our output has seen enough; keep the interpreter from flushing into the closed pipe
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except Exception as error:
        if os.environ.get("SOFTSEAM_TRACEBACK"):
            raise
        error_console.print(
            f"[bold red]internal error:[/bold red] {escape(f'{type(error).__name__}: {error}')} "
            "(please report it with the traceback that SOFTSEAM_TRACEBACK=1 shows)",
            highlight=False,
            soft_wrap=True,
        )
        return FAILED


if __name__ == "__main__":
    sys.exit(main())
