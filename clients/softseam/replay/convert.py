"""A recording -> a rerun stream: world, curves, words and layout."""

from collections.abc import Mapping

import rerun as rr
import rerun.blueprint as rrb

from softseam.recording import Recording, time_of
from softseam.replay import paths
from softseam.replay.curves import log_curves
from softseam.replay.facts import log_event, log_hole, log_scale, summary
from softseam.replay.layout import layout
from softseam.replay.world import BodyLog, Scales, find_scales, log_tools
from softseam.report import ReportBuilder
from softseam.view import colors
from softseam.view.surface import DisplaySurface
from softseam.view.tool_shapes import tool_shapes
from softseam_protocol.messages.session import Event, Frame


def convert(recording: Recording, stream: rr.RecordingStream) -> rrb.Blueprint:
    """Log everything that there is to see; returns the layout that suits it."""
    builder = ReportBuilder(recording.bundle, facts=recording.facts)
    has_events = False
    step = recording.scene.step
    surfaces = {name: DisplaySurface(mesh) for name, mesh in recording.surfaces.items()}
    scales = {name: find_scales(recording, name, surface) for name, surface in surfaces.items()}
    logs = _begin(stream, recording, surfaces, scales)
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
    for hole in recording.holes:
        has_events = True
        _at(stream, hole.start, round(hole.start / step))
        log_hole(stream, hole)
    tabs = log_curves(stream, builder.columns, recording.scene)
    if not surfaces:
        return rrb.Blueprint(auto_views=True)
    first = next(iter(surfaces))
    log_scale(stream, surfaces[first], scales[first].stress)
    text = summary(recording, builder, scales)
    stream.log(paths.SUMMARY, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
    return layout(recording.scene, tabs, scales, surfaces, has_events=has_events)


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
    log_tools(stream, tools)
    models = {name: part.model for report in recording.reports() for name, part in report.parts.items()}
    found = {}
    for name, surface in surfaces.items():
        found[name] = BodyLog(stream, name, surface, scales[name], tools, colors.tones(name, models))
    return found


def _at(stream: rr.RecordingStream, time: float, step: int) -> None:
    stream.set_time("sim_time", duration=time)
    stream.set_time("step", sequence=step)
