"""What can be wrong with tools."""


class ToolError(ValueError):
    """A tool that cannot be used. The text names the tool and the remedy."""
