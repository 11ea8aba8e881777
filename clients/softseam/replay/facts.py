"""The words of a replay: summary, colour scale, events."""

import io
from collections.abc import Mapping

import numpy as np
import rerun as rr

from softseam.columns import most_telling
from softseam.recording import Hole, Recording
from softseam.replay import paths
from softseam.replay.world import Scales
from softseam.report import ReportBuilder
from softseam.view import colors
from softseam.view.surface import DisplaySurface
from softseam_protocol.messages.outcomes import EventKind
from softseam_protocol.messages.session import Event

_ALARMS = (
    *(EventKind.SOLVER, EventKind.SEAM, EventKind.PARTICIPANT_LOST, EventKind.ENERGY, EventKind.RECORDING),
    *(EventKind.NOT_DONE, EventKind.GONE, EventKind.CREEP, EventKind.OVERLAP),
)


def summary(recording: Recording, builder: ReportBuilder, scales: Mapping[str, Scales], pressed: float = 0.0) -> str:
    """Markdown: what was run, how it ended, how far to trust it, what the colours mean. pressed: the largest force
    between two bodies [N]."""
    report = builder.build()
    verdict, wall, seam = report["verdict"], report["wall"], report["seam"]
    lines = [f"# {recording.scene.name}", "", f"**{verdict['text']}**", ""]
    if recording.note:
        lines += [f"> {recording.note}", ""]
    for undone in report["not_done"]:
        lines += [f"> not done: {undone}", ""]
    lines += ["| | |", "|---|---|"]
    for name, entry in most_telling(report["quantities"]).items():
        if entry["max"] is not None:
            least, most = (_figure(entry[end], entry["unit"]) for end in ("min", "max"))
            lines.append(f"| {colors.label(name)} | {least} to {most} |")
    lines += [
        f"| worst seam gap | {colors.engineering(seam['worst_gap']['value'], 'm')} |",
        f"| exchanges a step | {report['exchanges']['mean']:.2f} |",
        f"| penetration | {colors.engineering(report['penetration']['worst'], 'm')} |",
        f"| real-time factor | {wall['rtf']:.3g} |" if wall["rtf"] else "| real-time factor | not known |",
        f"| steps | {report['steps']} of {1e3 * recording.scene.step:g} ms |",
    ]
    for label, (_, names) in colors.grouped(builder.columns.models).items():
        cells = sum(report["parts"][name]["n_elements"]["max"] for name in names)
        lines.append(f"| {label} | {cells:.0f} cells at most |")
    lines += [
        "",
        f"**Colours.** {_painted(builder.columns.models)} Yellow arrows: contact forces on the body. "
        "Green: seam nodes and the seam's force on the near side. Magenta: what two bodies do to each other, in all."
        + (" Paler: asleep." if recording.scene.sleep is not None else ""),
        "",
        *dict.fromkeys(  # bodies of a kind have them alike
            f"Longest arrows: contact {colors.engineering(scale.contact, 'N')}, seam "
            f"{colors.engineering(scale.multiplier, 'N')} a node."
            for scale in scales.values()
        ),
        *([f"Between two bodies: at most {colors.engineering(pressed, 'N')}."] if pressed > 0.0 else []),
        "",
        f"Seed {recording.seed}; softseam {recording.facts.get('softseam', '?')}; {recording.facts.get('machine', '')}",
    ]
    return "\n".join(lines)


def _painted(models: Mapping[str, str]) -> str:
    """What the body's colours mean."""
    painted = colors.grouped(models).items()
    return " ".join(f"{colors.named(tone).capitalize()}: {label}." for label, (tone, _) in painted)


def log_scale(stream: rr.RecordingStream, surface: DisplaySurface, top: float) -> None:
    """The colour scale as a small picture."""
    from matplotlib.figure import Figure

    ink = "#d8dce4"
    figure = Figure(figsize=(4.2, 0.95), dpi=200, facecolor="#181b22")
    axes = figure.add_axes((0.06, 0.48, 0.88, 0.3))
    ramp = colors.stress_colors(np.linspace(0.0, top, 512), top)
    axes.imshow(ramp[None, :, :], aspect="auto", extent=(0.0, top * surface.load_factor, 0.0, 1.0))
    axes.set_yticks([])
    axes.tick_params(colors=ink, labelsize=8, length=2)
    axes.set_xlabel(f"{surface.load_label}, fixed over the run", color=ink, fontsize=8)
    for spine in axes.spines.values():
        spine.set_visible(False)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", facecolor=figure.get_facecolor())
    stream.log(paths.SCALE, rr.EncodedImage(contents=buffer.getvalue(), media_type="image/png"), static=True)


def log_event(stream: rr.RecordingStream, event: Event) -> None:
    level = rr.TextLogLevel.WARN if event.kind in _ALARMS else rr.TextLogLevel.INFO
    stream.log(paths.LOG, rr.TextLog(f"{event.kind}: {event.message}", level=level))


def log_hole(stream: rr.RecordingStream, hole: Hole) -> None:
    stream.log(paths.LOG, rr.TextLog(f"{EventKind.RECORDING}: the recording {hole}", level=rr.TextLogLevel.WARN))


def _figure(value: float, unit: str) -> str:
    return f"{100 * value:.3g} %" if unit == "1" else colors.engineering(value, unit)
