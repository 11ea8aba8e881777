"""Coupling schemes on two linear sides, where spectral radii and rates are exact: a study, which no run uses.

What the scene's `seam.scheme` names is in `loops`. Tests and the atlas prove here what those loops keep and lose.
"""
