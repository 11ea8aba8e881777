"""Do claims hold? Regenerates docs/results/claims.md: `make claims`.

Each scene of claim_scenes.py, claim_variants.py, claim_others.py and claim_grips.py is run as it is, as its sibling,
and as its truth: by FEM, on cells half as long or shorter, with steps a quarter as long. The error of a curve is the L2
norm over time of its difference to the truth's. What was run is kept in out/claims, so what was interrupted goes on
where it was; other solvers begin anew. All of it takes some twenty minutes of one core.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from time import process_time
from typing import Any

from benchmarks.claim_case import Case
from benchmarks.claim_grips import grips
from benchmarks.claim_others import others
from benchmarks.claim_scenes import cases
from benchmarks.claim_variants import varied
from benchmarks.claims_page import AS_THEY_ARE, CURVE, GRIPS, OTHERS, VARIED, Row, page
from rich.console import Console

from softseam.claims.beside import reported, run_here
from softseam.claims.claim import READINGS, Scale, claims, difference, measured
from softseam.claims.sibling import cell_edges, sibling_of
from softseam.embedded import EmbeddedBackend, solver_digest
from softseam.session import Session
from softseam.variants import with_settings
from softseam_protocol.facts import machine
from softseam_protocol.quantities import OF_TOOLS
from softseam_protocol.scene.bodies import BodySpec
from softseam_protocol.scene.file import bundle_scene, scene_hash

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / "out" / "claims"
SEEDS = (41, 42)
"""of what the varied scenes are drawn with"""
SEED_OF_OTHERS, SEED_OF_GRIPS = 43, 44
"""other ones, and grips"""
STEPS = 4.0
"""how many times shorter the truth's steps are"""


def main() -> None:
    console, rows, solvers = Console(), [], solver_digest()
    KEPT.mkdir(parents=True, exist_ok=True)
    every = [(AS_THEY_ARE, 0, case) for case in cases()]
    every += [(VARIED, seed, case) for seed in SEEDS for case in varied(seed)]
    every += [(OTHERS, 0, case) for case in others(SEED_OF_OTHERS)]
    every += [(GRIPS, 0, case) for case in grips(SEED_OF_GRIPS)]
    for among, seed, case in every:
        key = hashlib.sha256(f"{solvers} {scene_hash(bundle_scene(case.scene, case.files))} {case.truth}".encode())
        path = KEPT / f"{case.scene.name}-{key.hexdigest()[:12]}.json"
        if not path.exists():
            path.write_text(json.dumps(three_runs(case)))
        found = rows_of(case, among, seed, json.loads(path.read_text()))
        rows += found
        for row in found:
            claim = row.why if row.claim is None else f"claim {row.claim:.2%}"
            console.print(f"{row.told}, {row.quantity}, {row.of}: error {row.error:.2%}, {claim}", highlight=False)
    (ROOT / "docs" / "results" / "claims.md").write_text(page(rows, machine(), solvers[:12]))


def three_runs(case: Case) -> dict[str, Any]:
    """The run, its sibling, and the truth."""
    bundle = bundle_scene(case.scene, case.files)
    with Session(case.scene, bundle, EmbeddedBackend(bundle)) as session:
        frames = session.reset().frames
        sibling = sibling_of(case.scene, frames)
        session.run()  # caches are warm from now on
        session.reset()
        began = process_time()
        report = reported(session)
        seconds = process_time() - began
    run = {"outcome": report["verdict"]["outcome"], "quantities": report["quantities"], "seconds": seconds}
    body = case.scene.body
    assert isinstance(body, BodySpec)
    edges = cell_edges(body, frames["body"]) / case.truth
    shorter = f"body.cell=[{', '.join(f'{edge:.12g}' for edge in edges)}]"
    finer = with_settings(case.scene, (f"step={case.scene.step / STEPS:.12g}", "regions={default: fem}", shorter))
    other = run_here(bundle_scene(sibling.scene, case.files))
    truth = run_here(bundle_scene(finer, case.files))
    return {
        "cells": len(frames["body"].cell_near),
        "scale": asdict(Scale.of(case.scene, report, sibling.finer, sibling.cell)),
        "foreseen": sibling.share,
        **{name: compact(case, each) for name, each in (("run", run), ("sibling", other), ("truth", truth))},
    }


def compact(case: Case, found: dict[str, Any]) -> dict[str, Any]:
    """What is compared of a run: forces and displacements; stress at a probe beside an edge may have no limit."""
    names = [name for name in case.scene.asked if not name.endswith("von_mises")]
    names += [name for name in found["quantities"] if name.rpartition(".")[2] in OF_TOOLS]
    return found | {"quantities": {name: found["quantities"][name] for name in names}}


def rows_of(case: Case, among: str, seed: int, found: dict[str, Any]) -> list[Row]:
    """One for the curve of each quantity of a scene, and for each number that is read off it."""
    run, sibling, truth = (found[name] for name in ("run", "sibling", "truth"))
    scale = Scale(**found["scale"])
    claimed = claims(run["quantities"], sibling["quantities"], scale)
    rows = []
    for name, mine in run["quantities"].items():
        (off, size), true = difference(mine, sibling["quantities"][name]), truth["quantities"][name]
        errors = {CURVE: difference(true, mine)[0]}
        errors |= {of: abs(read(*measured(true))[0] - read(*measured(mine))[0]) for of, read in READINGS.items()}
        for of, error in errors.items():
            claim = claimed[name] if of == CURVE else claimed[name][of]
            rows.append(
                Row(
                    told=case.told,
                    among=among,
                    seed=seed,
                    kind=case.kind,
                    quantity=name,
                    cells=found["cells"],
                    finer=scale.finer,
                    of=of,
                    error=error / size,
                    claim=None if claim["absolute"] is None else claim["absolute"] / size,
                    why=claim["why"],
                    difference=off / size,
                    cost=sibling["seconds"] / run["seconds"],
                    outcomes=tuple(each["outcome"] for each in (run, sibling, truth)),
                )
            )
    return rows


if __name__ == "__main__":
    main()
