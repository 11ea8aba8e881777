"""A recording -> a rerun stream: world, curves, words and layout."""

from collections.abc import Mapping

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from softseam.recording import Recording, time_of
from softseam.replay import paths
from softseam.replay.curves import log_curves
from softseam.replay.facts import log_event, log_hole, log_scale, summary
from softseam.replay.layout import layout
from softseam.replay.pairs import PairLog
from softseam.replay.world import BodyLog, Scales, find_scales, log_tools, shared
from softseam.report import ReportBuilder
from softseam.view import colors
from softseam.view.pair_forces import largest_totals
from softseam.view.surface import DisplaySurface
from softseam.view.tool_shapes import tool_shapes
from softseam_protocol.messages.session import Event, Frame, StepReport


def convert(recording: Recording, stream: rr.RecordingStream) -> rrb.Blueprint:
    """Log everything that there is to see; returns the layout that suits it."""
    builder = ReportBuilder(recording.bundle, facts=recording.facts)
    has_events = False
    step = recording.scene.step
    surfaces = {name: DisplaySurface(mesh) for name, mesh in recording.surfaces.items()}
    scales = shared({name: find_scales(recording, name, surface) for name, surface in surfaces.items()}, surfaces)
    logs = _begin(stream, recording, surfaces, scales)
    pressed = largest_totals(recording)
    pairs = PairLog(stream, recording, surfaces, float(np.quantile(pressed, 0.9)) if len(pressed) else 0.0)
    for message in recording:
        builder.add(message)
        header = message.header
        if isinstance(message, Event):
            has_events = True
            _at(stream, header.time, header.step)
            log_event(stream, message)
        elif isinstance(message, Frame) and message.body in logs:
            _at(stream, time_of(message, step), header.step)
            logs[message.body].log(message)
            pairs.log(message)
        elif isinstance(message, StepReport):
            pairs.step(message)
            if recording.scene.sleep is not None:
                _at(stream, header.time + step, header.step)
                _log_sleep(message, logs)
    for hole in recording.holes:
        has_events = True
        _at(stream, hole.start, round(hole.start / step))
        log_hole(stream, hole)
    tabs = log_curves(stream, builder.columns, recording.scene)
    if not surfaces:
        return rrb.Blueprint(auto_views=True)
    first = next(iter(surfaces))
    log_scale(stream, surfaces[first], scales[first].stress)
    text = summary(recording, builder, scales, float(pressed.max(initial=0.0)))
    stream.log(paths.SUMMARY, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
    return layout(recording.scene, tabs, scales, surfaces, builder.columns.models, has_events=has_events)


def _begin(
    stream: rr.RecordingStream,
    recording: Recording,
    surfaces: Mapping[str, DisplaySurface],
    scales: Mapping[str, Scales],
) -> dict[str, BodyLog]:
    """Log what never changes; what logs the frames of each body."""
    if not surfaces:
        return {}
    extent = max(surface.extent for surface in surfaces.values())
    meshes = next(iter(recording.surfaces.values())).tools
    tools = tool_shapes(recording.scene, extent, meshes)
    _at(stream, 0.0, 0)
    log_tools(stream, tools)
    models = {name: part.model for report in recording.reports() for name, part in report.parts.items()}
    found = {}
    for name, surface in surfaces.items():
        own = colors.tones(name, models), recording.scene.sleep is not None
        found[name] = BodyLog(stream, name, surface, scales[name], tools, *own)
    return found


def _log_sleep(report: StepReport, logs: Mapping[str, BodyLog]) -> None:
    """Whose parts took no iteration in a step was asleep."""
    awake = {part.body for part in report.parts.values() if part.iterations}
    for name, log in logs.items():
        log.sleep(name not in awake)


def _at(stream: rr.RecordingStream, time: float, step: int) -> None:
    stream.set_time("sim_time", duration=time)
    stream.set_time("step", sequence=step)
