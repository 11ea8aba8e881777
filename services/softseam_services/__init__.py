"""The services of softseam: body, tools, both models, orchestrator, recorder."""

from softseam_services.kernel_cache import drop_stale_kernels, kernel_packages

drop_stale_kernels(kernel_packages())
