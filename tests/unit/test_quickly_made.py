"""Messages that are made quickly are the frozen dataclasses that they were."""

from __future__ import annotations

import copy
import inspect
import pickle
from dataclasses import FrozenInstanceError, dataclass, field, fields, replace

import numpy as np
import pytest

from softseam_protocol import messages
from softseam_protocol.quickly_made import altered, quickly_made


@dataclass(frozen=True, slots=True)
class Slow:
    name: str
    many: list[int] = field(default_factory=list)
    size: float = 1.5


@quickly_made
@dataclass(frozen=True, slots=True)
class Quick:
    name: str
    many: list[int] = field(default_factory=list)
    size: float = 1.5


def test_it_is_the_dataclass_that_was_declared() -> None:
    one = Quick("a", size=2.0)
    assert type(one) is Quick
    assert (one.name, one.many, one.size) == ("a", [], 2.0)
    assert one == Quick("a", [], 2.0) != Quick("b", [], 2.0)
    assert repr(one) == repr(Slow("a", size=2.0)).replace("Slow", "Quick")
    assert one.many is not Quick("a").many
    assert inspect.signature(Quick).parameters.keys() == inspect.signature(Slow).parameters.keys()
    assert [each.name for each in fields(Quick)] == [each.name for each in fields(Slow)]
    assert Quick.__match_args__ == Slow.__match_args__


def test_copies_are_of_the_same_class_and_as_frozen() -> None:
    one = Quick("a", [1])
    for other in (replace(one, size=1.5), copy.copy(one), copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
        assert type(other) is Quick
        assert other == one
        with pytest.raises(FrozenInstanceError):
            other.name = "b"  # type: ignore[misc]
        with pytest.raises(FrozenInstanceError):
            del other.name


def test_missing_and_unknown_arguments_are_refused_by_name() -> None:
    with pytest.raises(TypeError, match="name"):
        Quick()  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="colour"):
        Quick("a", colour="red")  # type: ignore[call-arg]


def test_messages_of_every_step_are_made_quickly() -> None:
    """The gate of what a step costs: none of them is filled by one call a field."""
    header = messages.Header(1, "local", "", 0, 0, 0, 0.0)
    assert type(header) is messages.Header
    with pytest.raises(FrozenInstanceError):
        header.step = 1  # type: ignore[misc]
    for name in ("Header", "ToolMotion", "Advance", "Advanced", "RegionReport", "SeamReport", "StepReport", "Fields"):
        assert getattr(messages, name).__init__.__code__.co_name == "made"
    assert np.shape(messages.Commit(header).seam_settle) == (0, 3)


def test_a_subclass_is_made_as_it_is_declared() -> None:
    class Named(Quick):
        """Adds nothing."""

    @dataclass(frozen=True)
    class Longer(Quick):
        length: float = 0.5

    @dataclass(frozen=True, slots=True)
    class Slotted(Quick):
        length: float = 0.5

    for cls in (Named, Longer, Slotted):
        one = cls("a", size=2.0)
        assert type(one) is cls
        assert (one.name, one.many, one.size) == ("a", [], 2.0)
        assert replace(one, name="b").name == "b"
        assert pickle.loads(pickle.dumps(Quick("a"))) == Quick("a")
        with pytest.raises(FrozenInstanceError):
            one.name = "b"  # type: ignore[misc]
    assert Longer("a", length=3.0).length == Slotted("a", length=3.0).length == 3.0


def test_what_is_altered_is_as_if_replaced() -> None:
    one = Quick("a", [1], 2.0)
    other = altered(one, size=3.0, name="b")
    assert other == replace(one, size=3.0, name="b") and type(other) is Quick
    assert other.many is one.many
    assert altered(one) == one
    with pytest.raises(KeyError):
        altered(one, weight=1.0)
