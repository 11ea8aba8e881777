"""A scene's body spec -> the body in cells."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from softseam_protocol.inner_ball import Ball, inner_ball
from softseam_protocol.material_borders import material_borders, pieces
from softseam_protocol.scene.bodies import MOST_CELLS, BlockShape, BodySpec, MeshShape
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.tools import BoxTool, PlaneTool
from softseam_protocol.tool_borders import Line, tool_borders
from softseam_services.body.around_ball import block_around
from softseam_services.body.block import block_surface, bordered_line, graded_block, graded_line
from softseam_services.body.body import Body, Floats, Ints, Surface
from softseam_services.body.default_cells import block_edge, solid_edges
from softseam_services.body.embed import embed, read_solid
from softseam_services.body.errors import MeshError
from softseam_services.body.friction_field import draw_field
from softseam_services.body.hexahedra import OwnCells, numbered_cells, own_cells
from softseam_services.body.inclusions import materials_at, octant_centres
from softseam_services.body.lattice import divide, number_nodes
from softseam_services.body.mass import lump_full
from softseam_services.body.materials import build_material, build_materials
from softseam_services.body.mesh_io import read_hexahedra, read_tetrahedra
from softseam_services.body.particles import ParticleBody, clamped
from softseam_services.body.tetrahedra import tetrahedral_cells
from softseam_services.body.tetrahedron import CORNERS, FILL
from softseam_services.body.tight_box import tightest_axes
from softseam_services.shapes import SHAPES

_ROUNDER = (
    "give shorter cells in body.cell, leave body.shape.towards out where a tool's edge lies close to the ball, or "
    "leave body.shape.borders out"
)
"""what to do about cells round a ball that are of poor shape"""


AnyBody = Body | ParticleBody


def build_body(scene: Scene, files: Mapping[str, bytes]) -> Body:
    """Build a body in cells; the same scene and files give the same bits in every process.

    files: contents by the path that the scene gives them; raises MeshError where a shape cannot be simulated, and
    ValueError for a body of particles.
    """
    spec = scene.body
    if spec.in_cells is None:
        raise ValueError(f"a {spec.kind} has no cells")
    return build_cells(scene, spec.in_cells, files)


def build_cells(scene: Scene, spec: BodySpec, files: Mapping[str, bytes]) -> Body:
    """The same, where its specification is known to be one of cells."""
    if isinstance(spec.shape, BlockShape):
        if spec.shape.graded:
            return _graded(scene, spec, spec.shape, files)
        return _block(scene, spec, spec.shape, _block_edges(scene, spec, spec.shape, files))
    if spec.shape.path not in files:
        raise MeshError(f"{spec.shape.path}: the file is missing; give its path relative to the scene file")
    build = {"own": _own, "tetrahedra": _tetrahedra, "boxes": _embedded}[spec.shape.cells]
    return build(scene, spec, spec.shape, files)


def _block(scene: Scene, spec: BodySpec, shape: BlockShape, cell: Floats) -> Body:
    size = np.array(shape.size)
    counts, edges = divide(size, cell)
    cell_grid, cell_nodes, node_grid = number_nodes(np.ones(counts, dtype=np.bool_))
    corner = np.array(spec.position) - np.array([0.5, 0.5, 0.0]) * size
    x_rest = corner + size * (node_grid / (2.0 * counts))
    octant_material = materials_at(spec, octant_centres(x_rest[cell_nodes[:, 13]], edges), float(edges.min()))
    return assemble(
        scene,
        spec,
        x_rest=x_rest,
        cell_nodes=cell_nodes,
        cell_grid=cell_grid,
        edges=edges,
        fill=np.ones((len(cell_nodes), 8)),
        cell_mass=lump_full(_densities(spec)[octant_material], edges),
        octant_material=octant_material,
        surface=block_surface(counts, edges, cell_nodes, node_grid),
    )


def _graded(scene: Scene, spec: BodySpec, shape: BlockShape, files: Mapping[str, bytes]) -> Body:
    counts, wanted = divide(np.array(shape.size), _block_edges(scene, spec, shape, files))
    ball = inner_ball(shape.size, spec.position, spec.inclusions) if shape.borders == "materials" else None
    if shape.towards or shape.borders == "materials":
        borders = _borders(scene, spec, shape, ball)
        lines = [
            bordered_line(edge, cell, grading, line)
            for edge, cell, grading, line in zip(shape.size, wanted, shape.gradings, borders, strict=True)
        ]
    else:
        along = zip(shape.size, counts, shape.gradings, strict=True)
        lines = [edge * graded_line(int(n), grading) for edge, n, grading in along]
    if ball is not None:
        cut = [pieces(edge, cell, line.planes) for edge, cell, line in zip(shape.size, wanted, borders, strict=True)]
        x, cell_nodes = block_around(lines, [ball.span(each, axis) for axis, each in enumerate(cut)], ball)
        lower = np.array(spec.position) - np.array([0.5, 0.5, 0.0]) * shape.size
        cells = numbered_cells("block", x + lower, cell_nodes, spec.material.density, remedy=_ROUNDER)
        return _of_hexahedra(scene, spec, cells)
    counts = np.array([len(line) - 1 for line in lines], dtype=np.int32)
    if shape.gradings == (1.0, 1.0, 1.0) and not shape.towards and all(_even(line) for line in lines):
        return _block(scene, spec, shape, np.array(shape.size) / counts)
    cells = own_cells("block", graded_block(lines), 1.0, "z", np.array(spec.position), spec.material.density)
    body = _of_hexahedra(scene, spec, cells)
    return replace(body, cell_grid=number_nodes(np.ones(counts, dtype=np.bool_))[0])


def _even(line: Floats) -> bool:
    """Whether cells that end there are of one length, up to rounding: those of the fast kernels."""
    return bool(np.ptp(np.diff(line)) <= 1e-9 * line[-1])


def _borders(scene: Scene, spec: BodySpec, shape: BlockShape, ball: Ball | None) -> tuple[Line, Line, Line]:
    """Planes that cells end in, of tools, of materials and of the box around a ball."""
    x, y, z = tool_borders(shape.size, spec.position, scene.tools, shape.towards)
    if not shape.towards:
        x = y = z = Line((), (True, True))
    if shape.borders == "materials":
        met = ball.planes if ball else material_borders(shape.size, spec.position, spec.inclusions)
        x, y, z = (
            replace(line, planes=tuple(sorted({*line.planes, *planes})))
            for line, planes in zip((x, y, z), met, strict=True)
        )
    return x, y, z


def _own(scene: Scene, spec: BodySpec, shape: MeshShape, files: Mapping[str, bytes]) -> Body:
    raw = read_hexahedra(shape.path, files[shape.path], shape.part)
    cells = own_cells(
        shape.path, raw, shape.scale or 1.0, shape.up or "z", np.array(spec.position), spec.material.density
    )
    return _of_hexahedra(scene, spec, cells)


def _tetrahedra(scene: Scene, spec: BodySpec, shape: MeshShape, files: Mapping[str, bytes]) -> Body:
    raw = read_tetrahedra(shape.path, files[shape.path], shape.part, middles=True)
    cells = tetrahedral_cells(
        shape.path, raw, shape.scale or 1.0, shape.up or "z", np.array(spec.position), spec.material.density
    )
    if len(cells.cell_nodes) > MOST_CELLS:
        raise MeshError(f"{shape.path}: {len(cells.cell_nodes):,} tetrahedra, more than {MOST_CELLS:,}; mesh coarsely")
    middles = cells.x_rest[cells.cell_nodes[:, CORNERS]].mean(axis=1)
    body = _of_own(scene, spec, cells, middles)
    return replace(body, fill=np.tile(FILL, (body.n_cells, 1)), tetrahedra=True)


def _of_hexahedra(scene: Scene, spec: BodySpec, cells: OwnCells) -> Body:
    return _of_own(scene, spec, cells, cells.x_rest[cells.cell_nodes[:, 13]])


def _of_own(scene: Scene, spec: BodySpec, cells: OwnCells, middles: Floats) -> Body:
    """Cells of a mesh, each of the one material in its middle (C, 3) [m]."""
    cell_material = materials_at(spec, middles, cells.edge)
    return assemble(
        scene,
        spec,
        x_rest=cells.x_rest,
        cell_nodes=cells.cell_nodes,
        cell_grid=cells.cell_grid,
        edges=np.full(3, cells.edge),
        fill=np.ones((len(cells.cell_nodes), 8)),
        cell_mass=cells.cell_mass * (_densities(spec) / spec.material.density)[cell_material][:, None],
        octant_material=np.repeat(cell_material[:, None], 8, axis=1),
        surface=cells.surface,
        notes=cells.notes,
        boxes=False,
    )


def _embedded(scene: Scene, spec: BodySpec, shape: MeshShape, files: Mapping[str, bytes]) -> Body:
    vertices, triangles, read_notes = read_solid(shape.path, files[shape.path], shape.scale, shape.up, shape.part)
    axes = tightest_axes(vertices) if _may_turn(spec) else np.eye(3)
    wanted = cell_edges(spec)
    if wanted is None:
        wanted = solid_edges(vertices @ axes, triangles, _half_width(scene, files))
    solid = embed(shape.path, vertices + np.array(spec.position), triangles, wanted, axes)
    centres = octant_centres(solid.x_rest[solid.cell_nodes[:, 13]], solid.edges, solid.axes)
    octant_material = materials_at(spec, centres, float(solid.edges.min()))
    fill, cell_mass = solid.lumped(_densities(spec)[octant_material])
    return assemble(
        scene,
        spec,
        x_rest=solid.x_rest,
        cell_nodes=solid.cell_nodes,
        cell_grid=solid.cell_grid,
        edges=solid.edges,
        fill=fill,
        cell_mass=cell_mass,
        octant_material=octant_material,
        surface=solid.surface,
        moments=solid.moments,
        axes=solid.axes,
        notes=tuple(f"{shape.path}: {note}" for note in read_notes),
    )


def _may_turn(spec: BodySpec) -> bool:
    """Whether cells may lie along a solid's own axes: where no box clamps nodes, which are in a plane along the scene's
    alone, and the law does not know the axes, as one for small strains does."""
    return not (spec.fixed or any(build_material(material).small for material in spec.materials))


def _densities(spec: BodySpec) -> Floats:
    """Of each material [kg/m^3] (m,)."""
    return np.array([material.density for material in spec.materials])


def _half_width(scene: Scene, files: Mapping[str, bytes]) -> float:
    """Of the narrowest tool that presses between nodes, infinite where there is none [m]."""
    between = (tool for tool in scene.tools.values() if not isinstance(tool, PlaneTool | BoxTool))
    return min((SHAPES[tool.kind].geometry(tool, files).half_width for tool in between), default=np.inf)


def _block_edges(scene: Scene, spec: BodySpec, shape: BlockShape, files: Mapping[str, bytes]) -> Floats:
    """Wanted cell edges of a block (3,) [m]."""
    wanted = cell_edges(spec)
    return np.full(3, block_edge(shape.size, _half_width(scene, files))) if wanted is None else wanted


def cell_edges(spec: BodySpec) -> Floats | None:
    """Wanted cell edges (3,) [m], or None where the scene leaves them open."""
    if spec.cell is None:
        return None
    return np.array(spec.cell) if isinstance(spec.cell, tuple) else np.full(3, spec.cell)


def assemble(
    scene: Scene,
    spec: BodySpec,
    *,
    x_rest: Floats,
    cell_nodes: Ints,
    cell_grid: Ints,
    edges: Floats,
    fill: Floats,
    cell_mass: Floats,
    octant_material: Ints,
    surface: Surface,
    moments: Floats | None = None,
    axes: Floats | None = None,
    notes: tuple[str, ...] = (),
    boxes: bool = True,
) -> Body:
    """Add what every shape has alike: material, clamped nodes, initial velocities, gravity."""
    fixed = clamped(x_rest, spec.fixed, float(np.ptp(x_rest, axis=0).max()))
    mass = np.zeros(len(x_rest))
    np.add.at(mass, cell_nodes, cell_mass)
    centre = mass @ x_rest / mass.sum()
    v_initial = np.array(spec.velocity) + np.cross(np.array(spec.spin), x_rest - centre)
    v_initial[fixed] = 0.0
    return Body(
        x_rest=np.ascontiguousarray(x_rest),
        cell_nodes=cell_nodes,
        cell_grid=cell_grid,
        edges=edges,
        fill=fill,
        cell_mass=cell_mass,
        fixed=fixed,
        materials=build_materials(spec.materials),
        octant_material=octant_material,
        surface=surface,
        gravity=np.array(scene.gravity),
        v_initial=v_initial,
        moments=np.zeros((0, 8, 27)) if moments is None else moments,
        boxes=boxes,
        axes=np.eye(3) if axes is None else axes,
        damping=spec.damping,
        friction_field=draw_field(spec.friction_field, np.array(spec.position)),
        notes=notes,
    )
