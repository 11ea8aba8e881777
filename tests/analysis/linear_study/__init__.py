"""Coupling schemes on two linear sides, where spectral radii and rates are exact: a study, which no run uses.

`position_constant` is the product's scheme, `staggered` its control; tests and the atlas prove here what each keeps.
"""
