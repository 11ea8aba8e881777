"""Forces, tangents, energies and stresses of a region's cells, whatever their element.

A model is general, or takes the fast path of hex27 and hex27_reduced with a material of which mu/2 I1 splits off. Cells
of these that are crushed count in part with full quadrature, see kernels/quadrature_blending.py. Cells with slivers of
the body beside them have joints, too (kernels/joints.py).
"""

from softseam_services.jit import njit

from . import cells, joints, point_tangents, point_volumes, points, relaxing_cells


@njit(cache=True, error_model="numpy")
def subtract_forces(x, model, parameters, work, r):
    """r <- r - f(x) in elimination order; returns the least J and the cell where it occurs.

    x (n, 3), r (3 n_free,) updated in place; scratch arrays of work are overwritten
    """
    if model.general:
        least, worst = points.subtract_forces(x, model, parameters.rule, work.part, work, r)
    else:
        least, worst = cells.subtract_forces(x, model, parameters, work, r)
        if work.watches[0] > 0:
            point_volumes.subtract_forces(x, model, parameters, work, r)
    if work.mixed[0] > 0:
        points.subtract_forces(x, model, parameters.full, work.full, work, r)
    if len(model.joints.cell) > 0:
        joints.subtract_forces(x, model, parameters, work, r)
    return least, worst


@njit(cache=True, error_model="numpy")
def add_cell_tangents(x, model, parameters, tree, work, safe):
    """Add K at x, every cell into its front of work.values (lower triangle), in place; safe: semi-definite."""
    if model.general:
        point_tangents.add_cell_tangents(x, model, parameters.rule, work.part, tree, work, safe)
    else:
        cells.add_cell_tangents(x, model, parameters, tree, work, safe)
        if work.watches[0] > 0 and not safe:
            point_volumes.add_cell_tangents(x, model, parameters, tree, work)
    if work.mixed[0] > 0:
        point_tangents.add_cell_tangents(x, model, parameters.full, work.full, tree, work, safe)
    if len(model.joints.cell) > 0:
        joints.add_tangents(x, model, parameters, work, safe)


@njit(cache=True, error_model="numpy")
def strain_energy(x, model, parameters, work):
    """Energy [J] whose gradient is f; work.energy (c,) <- what each cell has of it."""
    work.energy[:] = 0.0
    if model.general:
        energy = points.strain_energy(x, model, parameters.rule, work.part, work)
    else:
        energy = cells.strain_energy(x, model, parameters, work)
        if point_volumes.loses_volume(model):
            energy += point_volumes.strain_energy(x, model, parameters, work)
    if work.mixed[0] > 0:
        energy += points.strain_energy(x, model, parameters.full, work.full, work)
    if len(model.joints.cell) > 0:
        energy += joints.strain_energy(x, model, parameters, work)
    return energy


@njit(cache=True, error_model="numpy")
def cauchy_stress(x, model, parameters, work, out):
    """Cauchy stress xx yy zz yz xz xy of the octants, out (c, 8, 6) [Pa] updated in place; zero in an empty one."""
    if model.general:
        points.cauchy_stress(x, model, parameters.shown, work, out)
    else:
        cells.cauchy_stress(x, model, parameters, work, out)


@njit(cache=True, error_model="numpy")
def remember(x, model, parameters, work, end):
    """end (c, 8, n) <- what the octants remember at the end x of the step that work.material_state began; returns what
    the material dissipated in it [J]."""
    if model.general:
        return points.remember(x, model, parameters.rule, work, end)
    cells.deformation(x, model, parameters, work)
    return relaxing_cells.remember(model, parameters, work, end)
