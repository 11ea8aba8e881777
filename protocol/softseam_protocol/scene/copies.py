"""The bodies of a scene with each copy of those that repeat as one of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from softseam_protocol.scene.bodies import AnyBody, block_of
from softseam_protocol.scene.materials import InclusionMaterial, InclusionSpec, MaterialSpec
from softseam_protocol.scene.repeat import Copy, copies_of
from softseam_protocol.scene.spec import BoxRegion, Vector, wrong

Material = TypeVar("Material", MaterialSpec, InclusionMaterial)


def each_body(written: Mapping[str, AnyBody]) -> dict[str, AnyBody]:
    """Bodies by name, copies in the place of what they are copies of. Raises pydantic's error, about an entry of the
    bodies, where one cannot be repeated as it says, or a name is one of two."""
    found: dict[str, AnyBody] = {}
    for name, body in written.items():
        own = {name: body} if body.repeat is None else _copied(name, body)
        for each in own:
            if each in found or (each != name and each in written):
                raise wrong(
                    f"there is a body called {each!r}, as a copy of {name!r} is: give one another name", name, "repeat"
                )
        found |= own
    return found


def _copied(name: str, body: AnyBody) -> dict[str, AnyBody]:
    spec, block, cells = body.repeat, block_of(body), body.in_cells
    assert spec is not None
    if spec.stiffness and cells is None:
        raise wrong(f"{body.kind} has no such modulus: leave it out", name, "repeat", "stiffness")
    if spec.size and (block is None or body.said("fixed", ()) or block.body.inclusions):
        text = "only blocks without inclusions and clamps are made in other sizes: leave it out"
        raise wrong(text, name, "repeat", "size")
    return {copy.name: _copy(body, copy) for copy in copies_of(name, spec)}


def _copy(body: AnyBody, copy: Copy) -> AnyBody:
    """The body moved, with all that is said of places in it, and as large and stiff as the copy is."""
    changes: dict[str, Any] = {"repeat": None, "position": _moved(body.said("position", (0.0, 0.0, 0.0)), copy.by)}
    fixed: tuple[BoxRegion, ...] = body.said("fixed", ())
    if fixed:
        changes["fixed"] = _moved_boxes(fixed, copy.by)
    if body.regions is not None and body.regions.near is not None and body.regions.near.boxes:
        near = body.regions.near.model_copy(update={"boxes": _moved_boxes(body.regions.near.boxes, copy.by)})
        changes["regions"] = body.regions.model_copy(update={"near": near})
    cells, block = body.in_cells, block_of(body)
    if cells is not None:
        changes["inclusions"] = tuple(_inclusion(each, copy) for each in cells.inclusions)
        changes["material"] = _stiffer(cells.material, copy.stiffness)
    if block is not None and copy.size != 1.0:
        changes["shape"] = block.shape.model_copy(update={"size": _scaled(block.shape.size, copy.size)})
        edges = block.body.cell
        if edges is not None:
            changes["cell"] = _scaled(edges, copy.size) if isinstance(edges, tuple) else edges * copy.size
    return body.model_copy(update=changes)


def _inclusion(one: InclusionSpec, copy: Copy) -> InclusionSpec:
    shape = one.shape.model_copy(update={"position": _moved(one.shape.position, copy.by)})
    return one.model_copy(update={"shape": shape, "material": _stiffer(one.material, copy.stiffness)})


def _stiffer(material: Material, factor: float) -> Material:
    if material.young is None or factor == 1.0:
        return material
    return material.model_copy(update={"young": material.young * factor})


def _moved(at: Vector, by: Vector) -> Vector:
    return (at[0] + by[0], at[1] + by[1], at[2] + by[2])


def _moved_boxes(boxes: Sequence[BoxRegion], by: Vector) -> tuple[BoxRegion, ...]:
    return tuple(BoxRegion(min=_moved(box.min, by), max=_moved(box.max, by)) for box in boxes)


def _scaled(lengths: Vector, factor: float) -> Vector:
    return (lengths[0] * factor, lengths[1] * factor, lengths[2] * factor)
