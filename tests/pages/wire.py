"""docs/reference/messages.md, from the messages and the topics as they are declared."""

from __future__ import annotations

from pages.docstrings import as_markdown, cell, classes_of
from softseam_protocol import messages, topics

HEAD = """# Topics and messages

Made from `protocol/softseam_protocol/messages*` and `protocol/softseam_protocol/topics.py` by `make pages`. On the
wire a message is protobuf; a field's number is its place here plus one. Arrays are named by what they hold: `Vectors`
(n, 3), `Scalars` (n,), `Vector3` (3,), `Matrix` (n, m), `Wrenches` (n, 6), `Quaternions` (n, 4) as w, x, y, z,
`Stresses` (n, 8, 6) by cell and octant as xx, yy, zz, yz, xz, xy, `Octants` (n, 8), all float64; `Ids`, `ToolIds`,
`Triangles`, `Lines` int32; `Labels` int8. A default in brackets stands where a sender leaves the field out.

**Signs.** `wrench`: the body on the tool. `contact_force`: the tools on the body. `multiplier`: the seam on the near
side; the far side feels the reverse.

Recordings name some fields otherwise than [Observation](python.md#observation) does: `x` is `positions`, `point_x` is
`surface`, `energy` is `energies`.

## Topics

| key | | message | recorded |
|---|---|---|---|
"""
_HIDDEN = {"Array", "Least", "Name"}


def page() -> str:
    """docs/reference/messages.md."""
    lines = [HEAD.rstrip("\n")]
    lines += [f"| `{key}` | {kind} | {what} | {'yes' if kept else ''} |" for key, kind, what, kept in topics.table()]
    lines += ["", "## Messages"]
    for found in classes_of(messages.__name__):
        if found.name in _HIDDEN:
            continue
        lines += [f"\n### {found.name}\n"]
        if found.text:
            lines += [as_markdown(found.text), ""]
        lines += ["| field | type | |", "|---|---|---|"]
        for one in found.attributes:
            default = one.default if one.default and "field(" not in one.default else ""
            kind = cell(one.annotation) + (f" ({default})" if default else "")
            lines.append(f"| `{one.name}` | `{kind}` | {cell(one.text)} |")
    return "\n".join(lines) + "\n"
