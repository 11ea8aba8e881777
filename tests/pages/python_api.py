"""docs/reference/python.md, from the docstrings of what a program may use."""

from __future__ import annotations

import softseam
from pages.docstrings import Class, as_markdown, cell, class_of, classes_of, function_of

HEAD = """# Python

Made from the docstrings by `make pages`. SI units; shapes in brackets. What a session returns is an
[Observation](#observation); the messages inside it are in [messages.md](messages.md). Examples:
[Forces in Python](../start/forces-in-python.md), `clients/softseam/examples/`, `clients/softseam_studies/examples/`.

**Signs and orders.** `wrench` is what the *body exerts on the tool*, force and torque about the tool's position.
`contact_force` is the reverse: what the *tools exert on the body* at each surface point, so the forces on all points
sum up to minus the forces of all wrenches. A point that touches two tools (the lower edge of a cube between ground
and plate) is listed in `contact_tool` with one of them, so sums tool by tool may differ by what such points bear.
Quaternions are w, x, y, z; stresses xx, yy, zz, yz, xz, xy.
"""

SECTIONS = (
    ("Open a session", (("softseam.opening", "open"), ("softseam.scenes", "load_scene"))),
    ("Change a scene", (("softseam.variants", "with_model"), ("softseam.variants", "with_settings"))),
)
CLASSES = (
    ("softseam.session", "Session"),
    ("softseam.observation", "Observation"),
    ("softseam.observation", "ToolView"),
    ("softseam.gradient", "Gradient"),
    ("softseam.losses", "Run"),
    ("softseam.losses", "Slope"),
    ("softseam_studies.surrogate.surrogate", "Surrogate"),
    ("softseam_studies.surrogate.surrogate", "Told"),
    ("softseam.recording", "Recording"),
    ("softseam.recording", "Hole"),
    ("softseam.report", "ReportBuilder"),
    ("softseam.gym.scene_env", "SceneEnv"),
    ("softseam.gym.tofu_lift", "TofuLift"),
    ("softseam.gym.slice_lift", "SliceLift"),
    ("softseam.gym.push_gentle", "PushGentle"),
    ("softseam.gym.towel_fold", "TowelFold"),
    ("softseam.gym.point_cloud", "PointCloud"),
    ("softseam.gym.camera", "Camera"),
    ("softseam.gym.batch_env", "BatchEnv"),
    ("softseam.gym.randomise", "Randomise"),
    ("softseam_protocol.participant.part", "Part"),
    ("softseam_protocol.participant.state", "State"),
)


def _of_class(found: Class, module: str) -> list[str]:
    named = found.name if found.name in softseam.__all__ else f"{module}.{found.name}"
    lines = [f"\n## {found.name}\n", f"`{named}`\n", as_markdown(found.text)]
    if found.attributes:
        lines += ["\n| | type | |", "|---|---|---|"]
        lines += [f"| `{a.name}` | `{cell(a.annotation)}` | {cell(a.text)} |" for a in found.attributes]
    for method in (each for each in found.methods if each.text):  # what overrides another says nothing of its own
        lines += [
            f"\n### {found.name}.{method.name}\n",
            f"```python\n{method.signature}\n```\n",
            as_markdown(method.text),
        ]
    return lines


def page() -> str:
    """docs/reference/python.md."""
    lines = [HEAD]
    for title, functions in SECTIONS:
        lines.append(f"## {title}")
        for module, name in functions:
            function = function_of(module, name)
            lines += [f"\n### softseam.{name}\n", f"```python\n{function.signature}\n```\n", as_markdown(function.text)]
        lines.append("")
    for module, name in CLASSES:
        lines += _of_class(class_of(module, name), module)
    lines += ["\n## Errors\n", "All are `SoftseamError`s; the text names what is wrong and the remedy.\n"]
    lines += ["| | kind of | |", "|---|---|---|"]
    for error in classes_of("softseam.errors"):
        lines.append(f"| `{error.name}` | `{', '.join(error.bases)}` | {cell(' '.join(error.text.split()))} |")
    return "\n".join(lines) + "\n"
