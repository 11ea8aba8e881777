"""One file an integrator; `scheme` is what the kernels call, `table` knows the names of the scene file."""
