"""Ways of showing an environment, as Gymnasium names them: pictures as arrays, or a window on the display."""

import os
import sys
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np

from softseam.errors import BadInput
from softseam.gym.picture import FPS, Image

MODES = {"render_modes": ["human", "rgb_array"], "render_fps": FPS}
_ALONE = {**MODES, "render_modes": ["rgb_array"]}
_INSTEAD = "take render_mode='rgb_array', whose pictures need none"


def modes_here() -> dict[str, Any]:
    """Gymnasium's metadata: what can be shown on this machine."""
    has_display = sys.platform in ("win32", "darwin") or bool(os.environ.get("DISPLAY"))
    return dict(MODES if has_display else _ALONE)


def checked(render_mode: str | None) -> str | None:
    """The way of showing that was asked for. Raises BadInput where there is no such way, or no display for it."""
    if render_mode not in (None, *MODES["render_modes"]):  # type: ignore[misc]
        raise BadInput(f"render_mode={render_mode!r}: there are 'rgb_array', 'human', and None for nothing")
    if render_mode == "human" and render_mode not in modes_here()["render_modes"]:
        raise BadInput(f"render_mode='human' needs a display, and there is none (DISPLAY is not set): {_INSTEAD}")
    return render_mode


def warn_of_none(env: object) -> None:
    """Say how something is shown, where it was not asked for."""
    gymnasium.logger.warn(f"render() shows nothing of {type(env).__name__}: make it with render_mode='rgb_array'")


class Window:
    """Shows pictures one after another; where its user closes it, it stays closed."""

    def __init__(self, title: str) -> None:
        """Raises BadInput where no window opens."""
        try:
            import tkinter

            self._root: Any = tkinter.Tk()
        except ImportError as error:
            raise BadInput(f"render_mode='human' needs Python's tkinter ({error}): {_INSTEAD}") from error
        except tkinter.TclError as error:
            raise BadInput(f"render_mode='human' needs a display ({error}): {_INSTEAD}") from error
        self._root.title(title)
        self._root.protocol("WM_DELETE_WINDOW", self.close)
        self._label = tkinter.Label(self._root)
        self._label.pack()

    def show(self, image: Image) -> None:
        """Show a picture (height, width, 3)."""
        if self._root is None:
            return
        import tkinter

        data = f"P6 {image.shape[1]} {image.shape[0]} 255 ".encode() + image.tobytes()
        self._picture = tkinter.PhotoImage(master=self._root, data=data, format="ppm")  # Tk keeps no reference
        self._label.configure(image=self._picture)
        self._root.update()

    def close(self) -> None:
        """Close the window."""
        root, self._root = self._root, None
        if root is not None:
            root.destroy()


def tiled(images: Sequence[Image]) -> Image:
    """Up to four pictures as one."""
    if len(images) == 1:
        return images[0]
    four = [*images[:4], *[np.full_like(images[0], 255)] * 2][:4]
    return np.concatenate([np.concatenate(four[:2], axis=1), np.concatenate(four[2:], axis=1)])
