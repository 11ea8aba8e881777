"""What all specs of a scene are made of: frozen models, SI numbers, errors that name their place."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    SerializationInfo,
    ValidationInfo,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, SchemaValidator, core_schema

from softseam_protocol.table import Table

Vector = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]

LARGEST_BODY = 100.0
"""a body's edge above this is taken for wrong units [m]"""
SMALLEST_BODY = 1e-4
"""a body's edge below this is taken for wrong units [m]"""


def wrong(message: str, *at: str | int) -> PydanticCustomError:
    """An error about the entry `at` (a path from the spec that raises it); `file` finds its line."""
    return PydanticCustomError("scene", "{message}", {"message": message, "at": at})


def key(path: str) -> tuple[str, ...]:
    """Where an entry is, of its path as people write it: "models.fem.element"."""
    return tuple(path.split("."))


def not_among(message: str, have: list[str], *at: str | int) -> PydanticCustomError:
    """An error about the entry `at` that is none of those that there are."""
    return PydanticCustomError("scene", "{message}", {"message": message, "at": at, "have": have})


@dataclass(frozen=True, eq=False)  # tables have no hash, which a union of types asks for
class RowOf:
    """Of a text: the name of a row that the table has when a scene is read; the schema lists those that it has then."""

    table: Table[Any]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self._known, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {**handler(schema), "enum": list(self.table)}

    def _known(self, name: str) -> str:
        if name not in self.table:
            raise not_among(f"{json.dumps(name)} is not in the table of {self.table.title}", list(self.table))
        return name


def _some_direction(vector: Vector, info: ValidationInfo) -> Vector:
    if math.hypot(*vector) < 1e-12:
        raise wrong(f"the {info.field_name} must not be zero")
    return vector


Direction = Annotated[Vector, AfterValidator(_some_direction)]
"""a vector of any length but none"""


def check_edge(edge: float, *at: str | int) -> None:
    """Raise where an edge of a body [m] is too long or too short to be meant."""
    if edge > LARGEST_BODY:
        raise wrong(f"an edge of {edge:g} m is longer than {LARGEST_BODY:g} m: lengths are in metres", *at)
    if edge < SMALLEST_BODY:
        raise wrong(f"an edge of {edge:g} m is shorter than {SMALLEST_BODY:g} m: lengths are in metres", *at)


@dataclass(frozen=True)
class _Turn:
    """Of a vector: it may be given as roll, pitch and yaw, or as a quaternion, and is axis times angle once read."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(_rotation_vector, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        def numbers(count: int) -> JsonSchemaValue:
            return {"type": "array", "items": {"type": "number"}, "minItems": count, "maxItems": count}

        forms = [
            {"type": "object", "properties": {key: numbers(count)}, "required": [key], "additionalProperties": False}
            for key, count in _TURNS.items()
        ]
        return {"anyOf": [handler(schema), *forms]}


_TURNS = {"rpy": 3, "quaternion": 4}
"""how else a turn is given, and by how many numbers: roll, pitch, yaw about the fixed axes x, y, z in this order, as in
URDF [rad]; w, x, y, z of any length"""


def _rotation_vector(value: Any) -> Any:
    """Axis times angle [rad] of a turn that is given in another form; anything else as it is."""
    if not isinstance(value, Mapping):
        return tuple(value) if isinstance(value, list) else value
    if len(value) != 1 or not {*value} <= {*_TURNS}:
        raise wrong("a turn is axis times angle [x, y, z], or a mapping with one of rpy and quaternion")
    ((key, numbers),) = value.items()
    if not isinstance(numbers, list | tuple) or not all(
        isinstance(each, int | float) and not isinstance(each, bool) and math.isfinite(each) for each in numbers
    ):
        raise wrong(f"{key} is a list of {_TURNS[key]} numbers", key)
    if len(numbers) != _TURNS[key]:
        few = "few" if len(numbers) < _TURNS[key] else "many"
        raise wrong(f"a list of {len(numbers)} has too {few} entries: {key} takes {_TURNS[key]}", key)
    w, x, y, z = numbers if key == "quaternion" else _quaternion(*numbers)
    if math.hypot(w, x, y, z) == 0.0:
        raise wrong("no turn has a quaternion of zeros: [1, 0, 0, 0] is none at all", key)
    sine = math.hypot(x, y, z)
    share = math.copysign(2.0 * math.atan2(sine, abs(w)), w) / sine if sine > 0.0 else 0.0
    return (share * x, share * y, share * z)


def _quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """w, x, y, z of roll about x, then pitch about y, then yaw about z [rad]."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(0.5 * a), math.sin(0.5 * a)) for a in (roll, pitch, yaw))
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


Rotation = Annotated[Vector, _Turn()]
"""axis times angle [rad]; files may say `{rpy: [...]}` or `{quaternion: [w, x, y, z]}` instead"""


class Spec(BaseModel):
    """Base of every spec: frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


@dataclass(frozen=True, eq=False)  # as of RowOf
class OfKind:
    """Of a specification: its `kind` names a row of the table, as that is when a scene is read; the row is its class.
    The schema lists those that the table has then."""

    table: Table[Any]
    default: str = ""
    """kind of a specification that names none; '': each has to"""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_plain_validator_function(
            self._chosen, serialization=core_schema.plain_serializer_function_ser_schema(_dumped, info_arg=True)
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return handler(self._union()) if self.table else {"type": "object", "properties": {"kind": {"enum": []}}}

    def _chosen(self, value: Any, info: ValidationInfo) -> Any:
        if isinstance(value, Spec):
            if type(value) not in self.table.values():
                raise wrong(f"{type(value).__name__} is not in the table of {self.table.title}")
            return value
        if not self.table:
            raise wrong(f"the table of {self.table.title} has no rows yet: import the extension that adds them")
        union = _validator(tuple(self.table.items()), self.default)
        if info.mode == "json":
            # strict JSON, as of scene files: a list becomes a tuple and 1 a float, but "1" and true are not numbers
            return union.validate_json(json.dumps(value), strict=True)
        return union.validate_python(dict(value) if isinstance(value, Mapping) else value)

    def _union(self) -> CoreSchema:
        return _union(tuple(self.table.items()), self.default)


def _union(rows: tuple[tuple[str, type[Spec]], ...], default: str) -> CoreSchema:
    """Of the specifications by kind; default: as of `OfKind`."""
    kinds = {name: spec.__pydantic_core_schema__ for name, spec in rows}

    def kind_of(value: Any) -> str:
        kind = value.get("kind", default) if isinstance(value, dict) else getattr(value, "kind", default)
        return str(kind)

    return core_schema.tagged_union_schema(kinds, kind_of if default else "kind")


@lru_cache(maxsize=64)  # rows change where an extension comes, not from scene to scene
def _validator(rows: tuple[tuple[str, type[Spec]], ...], default: str) -> SchemaValidator:
    """What reads one of these specifications."""
    return SchemaValidator(_union(rows, default))


def _dumped(spec: Spec, info: SerializationInfo) -> dict[str, Any]:
    return spec.model_dump(mode=info.mode, exclude_none=info.exclude_none, exclude_defaults=info.exclude_defaults)


class BoxRegion(Spec):
    """An axis-aligned box in rest coordinates [m]."""

    min: Vector = Field(description="lower corner [m]")
    max: Vector = Field(description="upper corner [m]")

    @model_validator(mode="after")
    def _ordered(self) -> BoxRegion:
        for i, (low, high) in enumerate(zip(self.min, self.max, strict=True)):
            if low > high:
                raise wrong(f"min {low:g} exceeds max {high:g} along {'xyz'[i]}", "min", i)
        return self
