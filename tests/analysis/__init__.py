"""Other ways to couple than the product's one, on linear systems and in the real loop: a study, not in the wheel.

`linear_study` has coupling schemes on two linear sides, where spectral radii are exact; `loops` has loops that couple
FEM and XPBD by velocities, or without a compliance by an acceleration (`accelerations`), and `rows` adds them to the
product's tables. Tests prove what each keeps and loses. docs/decisions/02-other-coupling-loops.md says what came of it.
"""
