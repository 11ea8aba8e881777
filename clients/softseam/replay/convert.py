"""A recording -> a rerun stream: world, curves, words and layout."""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb

from softseam.recording import Recording
from softseam.replay import paths
from softseam.replay.curves import log_curves
from softseam.replay.facts import log_event, log_scale, summary
from softseam.replay.layout import layout
from softseam.replay.world import World, find_scales
from softseam.report import ReportBuilder
from softseam.view.surface import DisplaySurface
from softseam_protocol.messages.session import Event, Frame


def convert(recording: Recording, stream: rr.RecordingStream) -> rrb.Blueprint:
    """Log everything that there is to see; returns the layout that suits it."""
    builder = ReportBuilder(recording.bundle, facts=recording.facts)
    has_events = False
    step = recording.scene.step
    surface = None if recording.surface is None else DisplaySurface(recording.surface)
    scales = None if surface is None else find_scales(recording, surface)
    world = None if surface is None or scales is None else World(stream, recording, surface, scales)
    for message in recording:
        builder.add(message)
        header = message.header
        if isinstance(message, Event):
            has_events = True
            _at(stream, header.time, header.step)
            log_event(stream, message)
        elif isinstance(message, Frame) and world is not None:
            _at(stream, header.time + step, header.step)
            world.log(message)
    tabs = log_curves(stream, builder.columns, recording.scene)
    if scales is None or surface is None:
        return rrb.Blueprint(auto_views=True)
    log_scale(stream, surface, scales.stress)
    text = summary(recording, builder, scales)
    stream.log(paths.SUMMARY, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
    return layout(recording.scene, tabs, scales, surface, has_events=has_events)


def _at(stream: rr.RecordingStream, time: float, step: int) -> None:
    stream.set_time("sim_time", duration=time)
    stream.set_time("step", sequence=step)
