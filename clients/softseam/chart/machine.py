"""What the machine is called in a chart: its processor and how many cores it may use."""

from __future__ import annotations

import os
import platform
from pathlib import Path


def machine() -> str:
    """E.g. 'AMD EPYC 9B45, 2 cores'."""
    processor = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        named = (
            line.partition(":")[2].strip() for line in cpuinfo.read_text().splitlines() if line[:10] == "model name"
        )
        processor = next(named, processor)
    n_cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return f"{processor}, {n_cores} core{'s' if n_cores != 1 else ''}"
