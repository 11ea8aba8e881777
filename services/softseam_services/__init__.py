"""The services of softseam: body, tools, both models, orchestrator, recorder."""

from __future__ import annotations

from softseam_services.kernel_cache import drop_stale_kernels, kernel_packages

drop_stale_kernels(kernel_packages())
