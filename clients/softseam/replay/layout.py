"""How a replay is laid out: what a viewer shows before anybody touches it."""

from collections.abc import Collection, Mapping

import numpy as np
import rerun.blueprint as rrb

from softseam.columns import MANY
from softseam.replay import paths
from softseam.replay.curves import Plot
from softseam.replay.world import Scales
from softseam.view import colors
from softseam.view.surface import DisplaySurface
from softseam.view.tool_shapes import grid_spacing
from softseam_protocol.scene.scene import Scene
from softseam_protocol.scene.tools import PlaneTool

_BACKGROUND = (24, 27, 34)


def layout(
    scene: Scene,
    tabs: dict[str, list[Plot]],
    scales: Mapping[str, Scales],
    surfaces: Mapping[str, DisplaySurface],
    models: Mapping[str, str],
    *,
    has_events: bool,
) -> rrb.Blueprint:
    """Models and stress side by side, curves below, facts to the right. models: of each part."""
    ground = any(isinstance(tool, PlaneTool) for tool in scene.tools.values())
    edges = [f"+ {paths.TOOLS}/{name}/edges" for name in scene.tools]
    planes = [f"+ {paths.TOOLS}/{name}/**" for name, tool in scene.tools.items() if isinstance(tool, PlaneTool)]
    bodies = [paths.BodyPaths(name) for name in surfaces]
    load = next(iter(surfaces.values())).load_label.partition(" [")[0]
    camera = _Camera(scales.values(), max(surface.extent for surface in surfaces.values()), grid=not ground)
    edges += [f"+ {at.inclusions}" for at in bodies]
    parts = [f"+ {path}" for at in bodies for path in (at.near, at.far, at.cells, at.inclusions)]
    painted = colors.whole_bodies(models) or "coral near, blue far"
    shapes = camera.view(f"Models: {painted}", [*parts, f"+ {paths.TOOLS}/**"])
    stress = camera.view(load, [*(f"+ {at.stress}" for at in bodies), *edges, *planes])
    density = colors.engineering(max(scale.energy for scale in scales.values()), "J/m³")
    energy = camera.view(f"Energy, 0 to {density}", [*(f"+ {at.energy}" for at in bodies), *edges, *planes])
    fields = [energy]
    error = max(scale.error for scale in scales.values())
    if error > 0.0:
        wrong = colors.engineering(error, "J/m³")
        fields.append(camera.view(f"Error, 0 to {wrong}", [*(f"+ {at.error}" for at in bodies), *edges, *planes]))
    forces = camera.view(
        "Forces: contact yellow, seam green, between bodies magenta",
        [
            *(f"+ {path}" for at in bodies for path in (at.ghost, f"{at.forces}/**")),
            f"+ {paths.PAIRS}",
            *edges,
            *planes,
        ],
    )
    curves = [rrb.Horizontal(*[_plot(plot) for plot in plots], name=name) for name, plots in tabs.items() if plots]
    side: list[rrb.View | rrb.Container] = [
        rrb.TextDocumentView(origin=paths.SUMMARY, name="Run"),
        rrb.Spatial2DView(origin=paths.SCALE, name=f"Scale of {load}", background=_BACKGROUND),
    ]
    if has_events:
        side.append(_events())
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Horizontal(shapes, rrb.Tabs(stress, forces, *fields, active_tab=0)),
                rrb.Tabs(*curves, active_tab=0),
                row_shares=[1.7, 1.0],
            ),
            rrb.Vertical(*side, row_shares=[2.7, 0.65, 1.3][: len(side)]),
            column_shares=[4.2, 1.0],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="sim_time", play_state="playing", loop_mode="all"),
        auto_views=False,
        auto_layout=False,
    )


class _Camera:
    """The same view of the same things in every 3D window: the body's whole way, seen from the front right."""

    def __init__(self, scales: Collection[Scales], extent: float, *, grid: bool) -> None:
        known = [scale for scale in scales if np.isfinite(scale.low).all()]
        low = np.min([scale.low for scale in known], axis=0) if known else np.zeros(3)
        high = np.max([scale.high for scale in known], axis=0) if known else np.zeros(3)
        middle, size = 0.5 * (low + high), max(extent, float((high - low).max()))
        self._eye = rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=middle + size * np.array([0.95, -1.7, 0.62]),
            look_target=middle,
            eye_up=(0, 0, 1),
        )
        self._grid = rrb.LineGrid3D(
            visible=grid, spacing=grid_spacing(extent), color=(255, 255, 255, 26), stroke_width=1.0
        )

    def view(self, name: str, contents: list[str]) -> rrb.Spatial3DView:
        return rrb.Spatial3DView(
            origin=paths.WORLD,
            contents=contents,
            name=name,
            background=rrb.Background(kind=rrb.BackgroundKind.SolidColor, color=_BACKGROUND),
            line_grid=self._grid,
            eye_controls=self._eye,
        )


def _events() -> rrb.TextLogView:
    columns = rrb.archetypes.TextLogColumns(
        timeline_columns=[rrb.components.TimelineColumn(timeline="sim_time")],
        text_log_columns=[rrb.components.TextLogColumn("body")],
    )
    return rrb.TextLogView(origin=paths.LOG, name="Events", columns=columns)


def _plot(plot: Plot) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=plot.origin,
        name=plot.title,
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop, visible=1 < len(plot.names) <= MANY),
    )
