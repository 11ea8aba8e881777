"""`softseam conform`: runs the checks against a participant, shows how it gets on, and a table."""

from collections.abc import Callable
from dataclasses import dataclass

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from softseam.bar import Bar
from softseam.conform.examined_part import Service, Silent, Unmet, capabilities
from softseam.conform.table import CHECKS
from softseam.errors import BadInput, NoConnection
from softseam_protocol.bus.client import Bus
from softseam_protocol.bus.keys import SERVICE
from softseam_protocol.errors import BusError
from softseam_protocol.topics import DEFAULT_DEPLOYMENT, Keys

PASSED, FAILED, NOT_CLAIMED, NOT_RUN = "passed", "failed", "not claimed", "not run"


@dataclass(frozen=True)
class Row:
    """What became of one check."""

    name: str
    outcome: str
    expected: str = ""
    came: str = ""


def conform(
    endpoint: str, service: str | None, model: str | None, deployment: str | None, names: tuple[str, ...], out: Console
) -> bool:
    """Whether the participant passes all checks, or those named. Raises BadInput and NoConnection."""
    for name in names:
        if name not in CHECKS:
            raise BadInput(CHECKS.problem(name))
    try:
        keys = Keys(deployment or DEFAULT_DEPLOYMENT)
    except ValueError as error:
        raise BadInput(str(error)) from None
    try:
        with Bus(endpoint, role=SERVICE) as bus:
            chosen = _chosen(bus, keys, service)
            wait_answers(bus, keys, chosen)
            bar = Bar(out, f"conform {chosen}", len(names or CHECKS))
            try:
                rows = run_checks(Service(bus, keys.participant(chosen), model or chosen), names, bar.show)
            finally:
                bar.stop()
    except BusError as error:
        raise NoConnection(str(error)) from None
    out.print(_table(chosen, rows))
    failed = sum(row.outcome == FAILED for row in rows)
    out.print(f"{failed} of {len(rows)} checks failed" if failed else f"{chosen} conforms", highlight=False)
    return not failed


def run_checks(
    service: Service, names: tuple[str, ...] = (), progress: Callable[[int, str], None] = lambda done, name: None
) -> list[Row]:
    """A row for each check, or for those named; `progress` receives how many are done and which is next.

    Where no answer comes in time, the checks after that one are not run.
    """
    try:
        able = capabilities(service)
    except Unmet as unmet:
        return [Row("configure", FAILED, unmet.expected, unmet.came)]
    rows, todo = [], names or tuple(CHECKS)
    for done, name in enumerate(todo):
        progress(done, name)
        check = CHECKS[name]
        if not check.claimed(able):
            rows.append(Row(name, NOT_CLAIMED, f"Capabilities.{check.claim} is false"))
            continue
        try:
            check.run(service)
        except Unmet as unmet:
            rows.append(Row(name, FAILED, unmet.expected, unmet.came))
            if isinstance(unmet, Silent):
                return rows + [Row(left, NOT_RUN) for left in todo[done + 1 :]]
        else:
            rows.append(Row(name, PASSED))
        service.release()
    return rows


def _chosen(bus: Bus, keys: Keys, service: str | None) -> str:
    """The service that is asked, which must be there. Raises BadInput."""
    live = [keys.read_live(key) for key in bus.live(keys.every_live("participant"))]
    there = sorted({one.service for one in live if one is not None})
    if service is None and len(there) == 1:
        return there[0]
    if service in there:
        return service
    have = f"there are: {', '.join(there)}" if there else f"none lives in deployment {keys.deployment!r}: start it"
    wanted = "say which participant with --service" if service is None else f"no participant is called {service!r}"
    raise BadInput(f"{wanted}; {have}")


def wait_answers(bus: Bus, keys: Keys, service: str) -> None:
    """Return once the service sends back what its echo is sent. Raises NoConnection after 10 s."""
    if not bus.wait_answers(keys.every_live("participant", service), keys.echo(service)):
        raise NoConnection(
            f"participant {service!r} does not send back what {keys.echo(service)} is sent: serve that key"
        )


def _table(service: str, rows: list[Row]) -> Table:
    table = Table(title=f"participant {service}", title_justify="left")
    failed = any(row.expected for row in rows)  # where all passed, a row is a line
    for column in ("check", "what it says", "outcome", *(("expected", "came") if failed else ())):
        table.add_column(column, overflow="fold")
    colour = {PASSED: "green", FAILED: "bold red", NOT_CLAIMED: "yellow", NOT_RUN: "yellow"}
    for row in rows:
        says = CHECKS[row.name].says if row.name in CHECKS else "the block of the kit is built"
        outcome = f"[{colour[row.outcome]}]{row.outcome}[/]"
        table.add_row(row.name, says, outcome, *((escape(row.expected), escape(row.came)) if failed else ()))
    return table
