"""Where the numbers of `block` are: rows of its workspace, and entries of its constants."""

from softseam_services.body.materials.prototype import MAX_PARAMETERS

from .form import FORM, N_HOISTED
from .lanes import LANES

# Rows of the workspace: positions (node, component), inverse masses, Lambda (P then T), 8 max w, volume; then what only
# read-out uses: the stress that the shape asks for (P then T), J and the energy.
INVERSE_MASS, STRESS, SOFTNESS, VOLUME, WANTED, RATIO, ENERGY = 24, 32, 53, 54, 55, 76, 77
ROWS = FORM + N_HOISTED
N_STRESS = 21 * LANES
"""numbers of Lambda in a batch"""

# Entries of the constants array, see `hourglass.block_constants`.
MU, LAM, B, G, PAIR, SHEAR, TWIST, BOUND, PARAMETERS = 0, 1, 2, 5, 8, 17, 23, 26, 30
N_OF_BOX = PARAMETERS
"""numbers of boxes before PARAMETERS"""
N_CONSTANTS = PARAMETERS + MAX_PARAMETERS
