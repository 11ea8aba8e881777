"""Entries of a scene that name a row of a table: checked when the scene is read, listed in the published schema."""

from __future__ import annotations

from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from softseam_protocol.table import Table


class RowName:
    """Marks a text of a spec as the name of a row: `Annotated[str, RowName(QUANTITIES)]`.

    Rows that are added later count, too. An error names the table, the nearest row and all there are; `scene_file` adds
    file, line and key.
    """

    def __init__(self, table: Table[Any]) -> None:
        self._table = table

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self._known, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {**handler(schema), "enum": list(self._table)}

    def _known(self, name: str) -> str:
        if name in self._table:
            return name
        context = {"title": self._table.title, "name": name, "have": list(self._table)}
        raise PydanticCustomError("scene", 'the table of {title} has no row "{name}"', context)
