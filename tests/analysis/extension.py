"""Adds the study's loops to the product's tables as it is imported: a module for SOFTSEAM_EXTENSIONS."""

from __future__ import annotations

from analysis.rows import add

add()
