"""What a body in cells is made of: its material, and parts that are of another."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import (
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    SerializationInfo,
    SerializerFunctionWrapHandler,
    ValidationError,
    ValidationInfo,
    model_serializer,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from softseam_protocol.scene.foods import FOODS, with_food
from softseam_protocol.scene.parts import AnyPart
from softseam_protocol.scene.spec import NonNegative, Positive, Spec, not_among, wrong
from softseam_protocol.table import Table


class BranchSpec(Spec):
    """A part of the stress that fades while the shape is held: a spring in series with a dashpot."""

    share: float = Field(gt=0.0, le=1.0, description="share of the shear modulus that fades [1]")
    time: Positive = Field(description="time in which it fades to 1/e [s]")


MOST_BRANCHES = 6
MOST_BESIDE_A_SLIDER = MOST_BRANCHES - 2


class PlasticitySpec(Spec):
    """A part of the stress that yields: a spring in series with a slider, so that a dent stays."""

    yield_stress: Positive = Field(description="von Mises stress at which a quick load first leaves a dent [Pa]")
    share: float = Field(
        default=1.0,
        gt=0.0,
        le=1.0,
        description="share of the shear modulus that yields; what lasts beside it pulls back, and is kinematic "
        "hardening [1]",
    )
    hardening: NonNegative = Field(
        default=0.0, description="by how much the part that yields grows stronger over its plastic strain [Pa]"
    )


class MaterialSpec(Spec):
    """What every law has: elastic constants, which it meets Hooke's law with at small strains. Each kind is a subclass
    with the parameters of its own, a row of MATERIALS."""

    kind: str
    young: Positive = Field(description="Young's modulus [Pa]")
    poisson: float = Field(gt=-1.0, lt=0.5, description="Poisson's ratio, below 0.5: use 0.49 for rubber or gel [1]")
    density: Positive = Field(description="mass density at rest [kg/m^3]")
    retardation_time: NonNegative = Field(
        default=0.0,
        description="Kelvin and Voigt's viscosity over stiffness, of the whole body in both models: an oscillation of "
        "omega has the damping ratio half omega times this, and the loss factor tan delta omega times this; below a "
        "step's (of pbd a substep's) length implicit Euler damps more [s]",
    )
    relaxation: tuple[BranchSpec, ...] = Field(
        default=(),
        max_length=MOST_BRANCHES,
        description="parts of the stress that fade, a generalised Maxwell solid: young and poisson are what a quick "
        "load feels, the bulk modulus stays, and of the shear modulus lasts what is left of one",
    )

    plasticity: PlasticitySpec | None = Field(
        default=None, description="part of the stress that yields, by von Mises, so that a dent stays"
    )

    strength: Positive | None = Field(
        default=None,
        description="von Mises stress at which it would break, the stress of a bar that is pulled or pressed until it "
        "does; nothing breaks, but a run says how near it comes; an inclusion has none but its own [Pa]",
    )

    @model_validator(mode="after")
    def _fades_and_yields(self) -> Self:
        key = "relaxation" if self.relaxation else "plasticity"
        shares = [branch.share for branch in self.relaxation]
        if self.plasticity:
            shares.append(self.plasticity.share)
        if not shares:
            return self
        if round(math.fsum(shares), 9) > 1.0:
            raise wrong(
                f"shares of {', '.join(f'{share:g}' for share in shares)} are {math.fsum(shares):g} of the shear "
                "modulus: all of them are 1 at most, and what is left lasts",
                key,
            )
        if self.plasticity and len(self.relaxation) > MOST_BESIDE_A_SLIDER:
            raise wrong(f"{MOST_BESIDE_A_SLIDER} branches at most beside plasticity", key)
        if self.kind == "linear":
            raise wrong("linear knows small strains only, what relaxes or yields knows turns: use neo_hookean", key)
        if self.retardation_time > 0.0 and self.relaxation:
            raise wrong(
                "retardation_time and relaxation are two viscosities of one body: say one, retardation_time for what "
                "merely stops ringing",
                "relaxation",
            )
        return self


class NeoHookeanMaterial(MaterialSpec):
    """Compressible neo-Hookean solid."""

    kind: Literal["neo_hookean"] = "neo_hookean"


class LinearMaterial(MaterialSpec):
    """Hooke's law for small strains."""

    kind: Literal["linear"] = "linear"


class CorotatedMaterial(MaterialSpec):
    """Hooke's law in the frame that turns with the material."""

    kind: Literal["corotated"] = "corotated"


class StVenantKirchhoffMaterial(MaterialSpec):
    """Hooke's law between Green strain and second Piola-Kirchhoff stress."""

    kind: Literal["st_venant_kirchhoff"] = "st_venant_kirchhoff"


class StableNeoHookeanMaterial(MaterialSpec):
    """Neo-Hookean solid that is finite where it is flat or inverted."""

    kind: Literal["stable_neo_hookean"] = "stable_neo_hookean"


class MooneyRivlinMaterial(MaterialSpec):
    """Mooney-Rivlin solid."""

    kind: Literal["mooney_rivlin"] = "mooney_rivlin"
    ratio: float = Field(ge=0.0, le=1.0, description="c01/(c10 + c01), 0 is neo-Hookean, 0.2 fits many rubbers [1]")


DEFAULT_KIND = "neo_hookean"
_OF_BODY = ("kind", "retardation_time")
"""what an inclusion has of its body"""
MATERIALS: Table[type[MaterialSpec]] = Table(
    "material specifications",
    {
        "neo_hookean": NeoHookeanMaterial,
        "linear": LinearMaterial,
        "corotated": CorotatedMaterial,
        "st_venant_kirchhoff": StVenantKirchhoffMaterial,
        "stable_neo_hookean": StableNeoHookeanMaterial,
        "mooney_rivlin": MooneyRivlinMaterial,
    },
)
"""the specification of each kind; services have its law (softseam_services.body.materials.LAWS)"""


def material_spec(values: Mapping[str, Any], json_mode: bool = False) -> MaterialSpec:
    """The specification that these values ask for by their `kind`. Raises pydantic's errors."""
    kind = values.get("kind", DEFAULT_KIND)
    if not isinstance(kind, str) or kind not in MATERIALS:
        raise not_among(f"{json.dumps(kind)} is not in the table of {MATERIALS.title}", list(MATERIALS), "kind")
    spec = MATERIALS[kind]
    values = _that_say(values, spec)
    for key in values:
        if key not in spec.model_fields:
            raise _unknown_key(kind, key)
    # strict JSON, as of scene files: a list becomes a tuple and 1 a float, but "1" and true are not numbers
    return spec.model_validate_json(json.dumps(values), strict=True) if json_mode else spec.model_validate(values)


def _that_say(values: Mapping[str, Any], spec: type[Spec]) -> dict[str, Any]:
    """Without unknown keys that say nothing: `ratio: null`, as every material is written with."""
    return {key: value for key, value in values.items() if value is not None or key in spec.model_fields}


def _unknown_key(kind: str, key: str, *at: str | int) -> PydanticCustomError:
    """The error about a key that this kind does not have."""
    have = [name for name in MATERIALS[kind].model_fields if not at or name not in _OF_BODY]
    others = [name for name, spec in MATERIALS.items() if key in spec.model_fields]
    text = f"{kind} has no {key}" + (f": only {', '.join(others)} does" if others else "")
    if at and key in _OF_BODY:
        text = f"the {key} of an inclusion is the body's"
    context = {"message": text, "at": (*at, key), "have": have, "of_key": key}
    return PydanticCustomError("scene", "{message}", context)


class _ByKind:
    """Chooses the specification of a material by its kind, among what MATERIALS has then."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def choose(value: Any, info: ValidationInfo) -> MaterialSpec:
            if isinstance(value, MaterialSpec):
                return value
            value = with_food(value)
            if not isinstance(value, Mapping):
                raise PydanticCustomError("material", "should be a mapping of keys, or the name of a food")
            return material_spec(value, info.mode == "json")

        return core_schema.with_info_plain_validator_function(
            choose, serialization=core_schema.plain_serializer_function_ser_schema(_dumped, info_arg=True)
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        kinds = {name: spec.__pydantic_core_schema__ for name, spec in MATERIALS.items()}
        return _or_a_food(handler(core_schema.tagged_union_schema(kinds, "kind")))


def _or_a_food(said: JsonSchemaValue) -> JsonSchemaValue:
    """The schema of a material that may be named, too."""
    name = {
        "enum": list(FOODS),
        "type": "string",
        "description": "a food, with numbers of its own: softseam materials",
    }
    but = {"type": "object", "properties": {"food": name}, "required": ["food"]}
    return {"anyOf": [said, name, but]}


def _dumped(spec: MaterialSpec, info: SerializationInfo) -> dict[str, Any]:
    said = spec.model_dump(mode=info.mode, exclude_none=info.exclude_none, exclude_defaults=info.exclude_defaults)
    return said if info.exclude_none or info.exclude_defaults else _as_hashed(said)


def _as_hashed(said: dict[str, Any]) -> dict[str, Any]:
    """In version 1 of the scene format every material says its ratio, and none that it does not relax, yield or break:
    hashes of what ships with scenes hold it so."""
    unsaid = [key for key in ("relaxation", "plasticity", "strength") if not said.get(key)]
    return {"ratio": None} | {key: value for key, value in said.items() if key not in unsaid}


AnyMaterial = Annotated[MaterialSpec, _ByKind()]
"""a material of any kind that MATERIALS has"""


class InclusionMaterial(Spec):
    """What differs from the body's own material, or a food, which relaxes as that does; the law is the body's, and so
    are the names of its own parameters."""

    model_config = ConfigDict(extra="allow")

    young: Positive | None = Field(default=None, description="Young's modulus; default: the body's [Pa]")
    poisson: float | None = Field(
        default=None, gt=-1.0, lt=0.5, description="Poisson's ratio, below 0.5; default: the body's [1]"
    )
    density: Positive | None = Field(default=None, description="mass density at rest; default: the body's [kg/m^3]")

    @model_validator(mode="before")
    @classmethod
    def _said(cls, values: Any) -> Any:
        named = with_food(values)
        if named is not values:
            values = {"relaxation": [], **named}
        return _that_say(values, cls) if isinstance(values, Mapping) else values

    @model_serializer(mode="wrap")
    def _dumped(self, handler: SerializerFunctionWrapHandler, info: SerializationInfo) -> dict[str, Any]:
        said: dict[str, Any] = handler(self)
        if info.exclude_none or info.exclude_defaults:
            return said
        elastic = {"relaxation": said["relaxation"]} if "relaxation" in said else {}
        return _as_hashed(said) | elastic

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return _or_a_food(handler(schema))

    @model_validator(mode="after")
    def _differs(self) -> InclusionMaterial:
        if not self.model_dump(exclude_none=True):
            raise wrong("an inclusion differs from its body: give young, poisson or density")
        return self

    def within(self, body: MaterialSpec, *at: str | int) -> MaterialSpec:
        """The inclusion's material in a body of another; errors are about entries below `at`."""
        changes = self.model_dump(exclude_none=True)
        for key in changes:
            if key not in type(body).model_fields or key in _OF_BODY:
                raise _unknown_key(body.kind, key, *at)
        try:
            return type(body).model_validate({**body.model_dump(), "strength": None, **changes})
        except ValidationError as error:
            first = error.errors()[0]
            raise wrong(first["msg"], *at, *first["loc"]) from None


class InclusionSpec(Spec):
    """A part of the body that is of another material and grows together with the rest."""

    shape: AnyPart
    material: InclusionMaterial
