"""The atlas's map of ratios across the seam: its controls fail, what would grow is refused."""

from __future__ import annotations

from collections import Counter

from analysis import ratios_map as seam


def test_the_seam_s_failing_controls_fail_and_the_product_s_scheme_holds() -> None:
    """Implicit Euler by position is stable at all ratios; by velocity it grows; what would grow is refused."""
    for what, ratio in (("mass", 0.01), ("mass", 99.0), ("stiffness", 0.01), ("stiffness", 99.0)):
        assert seam.run(what, ratio, seam.PRODUCT, "implicit_euler").kind in ("accurate", "inaccurate")
        assert seam.run(what, ratio, seam.PRODUCT, "newmark").kind == "refused"
    worst = seam.run("mass", 10.0, "velocity, constant", "midpoint")
    assert worst.kind == "unstable" and "simulated" in worst.why
    grown = float(worst.why.partition("grows ")[2].partition(" times")[0])
    assert grown > 1e3, "what the scan calls unstable grows when it is simulated"


def test_a_small_map_holds_what_it_is_drawn_for() -> None:
    """As many cells as rows and columns; the product's own rows are no controls."""
    built = seam.build((0.1, 10.0))
    rows = built.panels[0].rows
    assert len(built.cells) == 2 * 2 * len(rows)
    kinds: dict[str, Counter[str]] = {row: Counter() for row in rows}
    for cell in built.cells:
        kinds[rows[cell.row]][cell.run().kind] += 1
    assert kinds["position, constant; implicit euler"]["accurate"] == 4
    assert kinds["position, constant; newmark"]["refused"] == 4
    assert kinds["velocity, constant; midpoint (control)"]["unstable"] > 0
