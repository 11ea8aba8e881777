"""Claims of a run: which sibling it has, where that runs, and what comes of both."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack
from typing import Any

from softseam.claims.beside import Beside, Lost, followed
from softseam.claims.claim import Scale, claims, growing, unclaimed
from softseam.claims.sibling import LARGEST_SHARE, NoSibling, Sibling, sibling_of
from softseam.errors import SoftseamError
from softseam.session import Session
from softseam_protocol.facts import cores
from softseam_protocol.messages.participant import Bundle
from softseam_protocol.quantities import OF_TOOLS
from softseam_protocol.scene.file import bundle_scene

_TIMED = "; a force times the motion, so what a step changes stands in for as much of the difference"
"""what is said of claims where one does"""
_SETUP = 300.0
"""longest time that a sibling may take to load the solvers, on a busy machine [s]"""
_LONGER = 20.0
"""time that it may then take beyond what the run took [s]"""
_SOON = 1.0
"""time that is waited for it without a word [s]"""


class Estimate:
    """A context around a run, whatever ends it; outside it nothing of the sibling is left.

    connect  endpoint of the services that simulate, where the sibling runs after the run; None: in this machine's
             other core, beside it
    wanted   whether to run the sibling; None: where it is foreseen to take no more than LARGEST_SHARE of the run's time
    """

    def __init__(self, connect: str | None, wanted: bool | None) -> None:
        self._connect, self._wanted = connect, wanted
        self._stack = ExitStack()
        self._beside: Beside | None = None
        self._sibling: Sibling | None = None
        self._bundle: Bundle | None = None
        self._waits = False
        self._none = "no claims, for --no-estimate: how far the values are off is not known" if wanted is False else ""

    def __enter__(self) -> Estimate:
        if not self._none and self._connect is None:
            self._beside = self._stack.enter_context(Beside())
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def begin(self, session: Session) -> None:
        """Find the sibling of a session that was just reset, and begin its run where there is a core for it."""
        if self._none:
            return
        try:
            self._sibling = sibling_of(session.scene, session.last.frames)
        except NoSibling as error:
            self._none = f"no claims: {error}"
            self._stack.close()
            return
        if self._wanted is None and self._sibling.share > LARGEST_SHARE:
            finer = "cells half as long" if self._sibling.finer else "longer cells"
            self._none = (
                f"no claims: a run on {finer}, to compare with, would take some {100.0 * self._sibling.share:.0f} % of "
                "this one's time; --estimate makes it"
            )
            self._stack.close()
            return
        self._bundle = bundle_scene(self._sibling.scene, session.bundle.files)
        if self._beside is not None:
            self._waits = cores() < 2
            if not self._waits:
                self._beside.begin(self._bundle)

    def found(self, report: Mapping[str, Any], waiting: Callable[[], None]) -> dict[str, Any]:
        """Claims of the run, as they stand in its report.

        report   of the run, whose session is closed
        waiting  called once where the sibling has to be waited for
        """
        if self._none or self._sibling is None or self._bundle is None:
            return _nothing(self._none or "no claims: the run did not begin")
        try:
            other = self._run_of_sibling(report["wall"]["total"], waiting)
        except (Lost, SoftseamError) as error:
            return _nothing(f"no claims: the run to compare with failed: {error}")
        return compared(report, other, self._sibling)

    def _run_of_sibling(self, took: float, waiting: Callable[[], None]) -> dict[str, Any]:
        """What it found; took: wall time of the run [s]. Raises Lost or SoftseamError."""
        assert self._bundle is not None
        if self._beside is None:
            from softseam.connected import ConnectedBackend

            assert self._connect is not None and self._sibling is not None
            waiting()
            backend = ConnectedBackend(self._bundle, self._connect, record=False, timeout=120.0)
            with Session(self._sibling.scene, self._bundle, backend) as session:
                session.reset()
                return followed(session)
        if self._waits:
            self._beside.begin(self._bundle)
        if not self._beside.ended(_SOON):
            waiting()
            if not self._beside.begun(_SETUP):
                raise Lost(f"it was not set up within {_SETUP:.0f} s")
            if not self._beside.ended(_LONGER + took):
                raise Lost(f"it took longer than the run, and {_LONGER:.0f} s more")
        return self._beside.result()


def compared(report: Mapping[str, Any], other: Mapping[str, Any], sibling: Sibling) -> dict[str, Any]:
    """What both reports claim; over a bus, where nobody knows the services' processor time, wall times are compared."""
    seconds = report["wall"]["total"] if report["wall"]["cpu"] is None else report["wall"]["cpu"]
    scale = Scale.of(sibling.scene, report, sibling.finer, sibling.cell)
    share = other["seconds"] / seconds if seconds > 0.0 else None
    longer = f"{'half' if sibling.finer else 'twice'} as long"
    cost = "" if share is None else f" ({100.0 * share:.0f} % of this run's time)"
    settled = other["outcome"] == report["verdict"]["outcome"]
    both = report["quantities"], other["quantities"]
    if settled:
        claimed, grow = claims(*both, scale), growing(*both, sibling.finer)
        also = ", ".join(_others(claimed, scale))
        also = f" ({also})" if also else ""
        text = (
            f"± is {scale.factor:.2g} times the difference{also}, less of a large one, to a run by FEM with cells and "
            f"steps {longer}{cost}{_TIMED if scale.timed else ''}"
        )
    else:
        why = f"not settled: the outcome is {other['outcome']!r} with cells and steps {longer}"
        claimed, grow = unclaimed(both[0], why), {}
        text = (
            f"the outcome is not settled: with cells and steps {longer} it is {other['outcome']!r}; shorten body.cell "
            "and step until both agree"
        )
    return {
        "settled": settled,
        "text": text,
        "factor": scale.factor,
        "sibling": {
            "settings": list(sibling.settings),
            "outcome": other["outcome"],
            "seconds": other["seconds"],
            "share": share,
            "foreseen_share": sibling.share,
        },
        "quantities": claimed,
        "growing": grow,
    }


def _others(claimed: Iterable[str], scale: Scale) -> Iterator[str]:
    """Factors of kinds of quantities that have one of their own, where there are some of these."""
    kinds = {name: name.rpartition(".")[2] for name in claimed}
    slips = {name for name, kind in kinds.items() if kind == "slip"}
    tools = {name for name, kind in kinds.items() if kind in OF_TOOLS}
    for of, names in (("tools' forces", tools), ("slip", slips)):
        factors = {scale.at(name).factor for name in names} - {scale.factor}
        if factors:
            yield f"of {of} {max(factors):.2g}"


def _nothing(text: str) -> dict[str, Any]:
    return {"settled": None, "text": text, "factor": None, "sibling": None, "quantities": {}, "growing": {}}
