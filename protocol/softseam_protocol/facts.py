"""What a recording or a report says about where it came from."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_PACKAGES = ("softseam", "numpy", "numba", "scipy", "protobuf", "mcap", "eclipse-zenoh")


def facts() -> dict[str, str]:
    """Versions and machine of this process."""
    found = {"python": platform.python_version(), "machine": processor(), "cores": str(cores())}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def machine() -> str:
    """Processor and the cores that this process may use, e.g. 'AMD EPYC 9B45, 2 cores'."""
    n_cores = cores()
    return f"{processor()}, {n_cores} core{'s' if n_cores > 1 else ''}"


def processor() -> str:
    """The processor's name, or its kind where it has no name."""
    kind = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, kind)


def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
