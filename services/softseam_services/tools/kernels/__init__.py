"""Kernels of tools; participants import them from here."""

from softseam_services.tools.kernels.gap import cell_distances, least_gaps, rotate, rotate_back, tool_gap, tool_reach

__all__ = ["cell_distances", "least_gaps", "rotate", "rotate_back", "tool_gap", "tool_reach"]
