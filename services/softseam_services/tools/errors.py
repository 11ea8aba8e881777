"""What can be wrong with tools."""

from __future__ import annotations


class ToolError(ValueError):
    """A tool that cannot be used. The text names the tool and the remedy."""
