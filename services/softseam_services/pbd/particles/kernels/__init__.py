"""Kernels of PBD on particles: one constraint a file.

Particles are rows x, y, z [m], w (inverse mass [1/kg], 0 holds a particle) of `xw` (n + LANES, 4); the last rows are
where the empty lanes of a batch look, with w = 0. Constraints come in batches of `WIDTH` that share no particle
(`coloring`), so that a sweep, batch after batch, is Gauss-Seidel whose result does not depend on the order inside a
batch. Every constraint function C has a multiplier lambda [unit of energy over C] with C + alpha lambda / h^2 = 0 at
the solution; a projection is

    d_lambda = -(C + alpha~ lambda) / (sum_i w_i |grad_i C|^2 + alpha~),   x_i += w_i grad_i C d_lambda,       (1)
    alpha~ = alpha / h^2

(Macklin et al. 2016, "XPBD", eq. 18). Here lambda is h^2 times the force's multiplier. Classic PBD (Mueller et al.
2007) is the same with alpha~ = 0 and d_lambda times a stiffness in (0, 1].
"""
