"""What a scene may say at one place: the keys of the spec there, and the description of the value."""

import types
import typing
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.spec import OfKind

Loc = tuple[str | int, ...]


def fields_of(spec: type[BaseModel]) -> dict[str, FieldInfo]:
    """The fields of a spec by the keys that files have for them."""
    return {field.alias or name: field for name, field in spec.model_fields.items()}


def keys_allowed(loc: Loc) -> list[str]:
    """Keys of the spec at an error's location (pydantic's, with union tags)."""
    keys: dict[str, None] = {}
    for candidate in _at(loc)[0]:
        if isinstance(candidate, type) and issubclass(candidate, BaseModel):
            keys.update(dict.fromkeys(fields_of(candidate)))
    return list(keys)


def described(loc: Loc) -> str:
    """Description of the value at a location, or an empty text."""
    return _at(loc)[1]


def _at(loc: Loc) -> tuple[list[Any], str]:
    candidates, description = [Scene], ""
    for item in loc:
        following: list[Any] = []
        for candidate in candidates:
            for annotation, text in _follow(candidate, item):
                following.append(annotation)
                description = text or description
        # an item that leads nowhere is the tag of a union: keep the members it may mean
        candidates = [m for a in following for m in _members(a)] if following else _tagged(candidates, item)
    return candidates, description


def _follow(candidate: Any, item: str | int) -> list[tuple[Any, str]]:
    if isinstance(candidate, type) and issubclass(candidate, BaseModel):
        field: FieldInfo | None = fields_of(candidate).get(str(item))
        if field is None:
            return []
        kinds = _kinds(field.metadata)
        return [(kind, field.description or "") for kind in kinds or [field.annotation]]
    origin, arguments = typing.get_origin(candidate), typing.get_args(candidate)
    if origin is dict and isinstance(item, str):
        return [(arguments[1], "")]
    if origin is tuple and isinstance(item, int):
        return [(arguments[0] if arguments[-1] is ... else arguments[min(item, len(arguments) - 1)], "")]
    return []


def _members(annotation: Any) -> list[Any]:
    """Members of nested unions, with annotations stripped."""
    origin = typing.get_origin(annotation)
    if origin is typing.Annotated:
        plain, *marks = typing.get_args(annotation)
        return _kinds(marks) or _members(plain)
    if origin in (types.UnionType, typing.Union):
        return [member for argument in typing.get_args(annotation) for member in _members(argument)]
    return [annotation]


def _kinds(marks: list[Any]) -> list[Any]:
    """The specs that a marker among these has by their kinds."""
    return [spec for mark in marks if isinstance(mark, OfKind) for spec in mark.table.values()]


def _tagged(candidates: list[Any], tag: str | int) -> list[Any]:
    def has(candidate: Any) -> bool:
        if not (isinstance(candidate, type) and issubclass(candidate, BaseModel)):
            return False
        kind = candidate.model_fields.get("kind")
        by_key = str(tag).removesuffix(" phase") in candidate.model_fields and str(tag).endswith(" phase")
        return by_key or (kind is not None and (kind.default == tag or tag in typing.get_args(kind.annotation)))

    return [c for c in candidates if has(c)] or candidates
