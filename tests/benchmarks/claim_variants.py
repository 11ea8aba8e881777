"""The same scenes with other cells, steps and material: what the rule of claims was not chosen on."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from benchmarks.claim_case import Case
from benchmarks.claim_scenes import cases

from softseam.variants import AS_GIVEN, with_settings
from softseam_protocol.scene.bodies import BodySpec

CELL, STEP, YOUNG = (0.8, 1.25), (0.75, 1.5), (0.6, 1.7)
"""smallest and largest factor of edges, step and Young's modulus [1]"""
POISSON = (-0.03, 0.04)
"""least and most that is added to Poisson's ratio, which stays below 0.49 [1]"""


def varied(seed: int) -> Iterator[Case]:
    """Each scene with numbers drawn for it."""
    for case in cases():
        draw, body = random.Random(f"{seed} {case.told}"), case.scene.body
        assert isinstance(body, BodySpec) and body.cell is not None
        material = body.material.model_dump()
        cell = draw.uniform(*CELL) * np.broadcast_to(body.cell, 3)
        settings = (
            f"body.cell=[{', '.join(f'{edge:.5g}' for edge in cell)}]",
            f"step={draw.uniform(*STEP) * case.scene.step:.5g}",
            f"body.material.young={draw.uniform(*YOUNG) * material['young']:.5g}",
            f"body.material.poisson={min(0.49, material['poisson'] + draw.uniform(*POISSON)):.4g}",
        )
        yield replace(case, scene=with_settings(case.scene, (*AS_GIVEN, *settings)))
