"""What a recording leaves for others: a bound of its own size, and a part of its disk that stays free."""

import errno
import os
from pathlib import Path

MOST = 16 << 30
"""of a recording: three hours of a block of 8x8x8 cells [B]"""
FLOOR = 256 << 20
"""that stay free on its disk [B]"""


def check_room(path: Path, size: int) -> None:
    """Raises OSError where a recording of so many bytes, in the file or about to be, may take no more."""
    if size >= MOST:
        raise OSError(errno.EFBIG, f"it holds the {MOST:,} B that a recording may")
    disk = os.statvfs(path.parent)
    if disk.f_bavail * disk.f_frsize < FLOOR:
        raise OSError(errno.ENOSPC, f"less than {FLOOR:,} B of its disk are free")
