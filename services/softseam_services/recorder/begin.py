"""What a recording says about where it came from."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from softseam_protocol.messages import SCHEMA_VERSION, Begin, Bundle, Header, SurfaceMesh, ToolSurface
from softseam_protocol.scene_file import scene_from_bundle
from softseam_services.body.body import Body
from softseam_services.tools.build import tool_meshes


def begin(bundle: Bundle, body: Body, session: str = "local", seed: int = 0) -> Begin:
    """The message that opens a session's recording."""
    header = Header(SCHEMA_VERSION, session, "", 0, 0, 0, 0.0)
    meshes = tool_meshes(scene_from_bundle(bundle), bundle.files)
    tools = {name: ToolSurface(mesh.vertices, mesh.triangles) for name, mesh in meshes.items()}
    return Begin(header=header, bundle=bundle, seed=seed, facts=facts(), surface=surface_mesh(header, body, tools))


def surface_mesh(header: Header, body: Body, tools: dict[str, ToolSurface]) -> SurfaceMesh:
    """The body's surface at rest and the cells behind it, for viewers.

    A point's rest position follows from its cell: center + local * edges / 2.
    """
    center = body.x_rest[body.cell_nodes[:, 13]]  # node (1, 1, 1) of 3 x 3 x 3
    surface = body.surface
    return SurfaceMesh(
        header=header,
        point_rest=center[surface.cell] + surface.local * (0.5 * body.edges),
        triangles=surface.triangles,
        cell_center=center,
        edges=body.edges,
        fill=body.fill,
        tools=tools,
    )


def facts() -> dict[str, str]:
    """Versions and machine of this process."""
    found = {"python": platform.python_version(), "machine": machine(), "cores": str(os.cpu_count() or 0)}
    for package in ("softseam", "numpy", "numba", "scipy", "protobuf", "mcap", "eclipse-zenoh"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def machine() -> str:
    """Processor and operating system in words."""
    processor = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        lines = cpuinfo.read_text().splitlines()
        named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
        processor = next(named, processor)
    return f"{processor}, {platform.system()} {platform.release()}"
