"""Kinds of interface between bodies, one file each; an extension adds its own."""

from collections.abc import Callable
from typing import Any

from softseam_coupling.interfaces.contact import Contact
from softseam_coupling.interfaces.kind import Kind, Meeting, Rows
from softseam_protocol.table import Table

__all__ = ["KINDS", "Kind", "Meeting", "Rows"]

KINDS: Table[Callable[[Any, Meeting, Meeting], Kind]] = Table("interfaces", {"contact": Contact})
"""builds an interface of a kind that a scene may name, from its specification and its two bodies"""
