"""Where the numbers of `block` are: rows of its workspace, and entries of its constants."""

from softseam_services.body.materials.prototype import MAX_PARAMETERS

from .form import FORM, N_HOISTED
from .lanes import LANES

# Rows of the workspace: positions (node, component), inverse masses, Lambda (P then T), 8 max w, volume; then what only
# read-out uses: the stress that the shape asks for (P then T), J and the energy.
INVERSE_MASS, STRESS, SOFTNESS, VOLUME, WANTED, RATIO, ENERGY = 24, 32, 53, 54, 55, 76, 77
# Then, of blocks that relax, what folds their branches (see `relaxing`), what they remember, and their shape now.
FOLD = FORM + N_HOISTED
FACING, STIFF, PRESSED, SHARE, REST, HELD, LOST = FOLD, FOLD + 6, FOLD + 7, FOLD + 8, FOLD + 9, FOLD + 21, FOLD + 22
"""T, its largest diagonal entry, mu', G, r, the energy beyond what these say, what was dissipated in the step [Pa]"""
N_FOLD, N_SWEPT = 23, 21
"""rows, and those of them that sweeps take"""
OF_STRAIN, OF_BENDING = 6, 12
"""numbers that a branch remembers of strain and of bending; before them as many are the last shape's"""
REMEMBERED = FOLD + N_FOLD
"""of the last shape C_bar, less 1, and q; then of one branch C_i, less 1, and h; and of the shape now as at first,
and J, less 1"""
BRANCH = REMEMBERED + OF_STRAIN + OF_BENDING
NOW = BRANCH + OF_STRAIN + OF_BENDING
VOLUME_NOW = NOW + OF_STRAIN + OF_BENDING
SLIPPED = VOLUME_NOW + 1
SLIP = SLIPPED + 1
"""of a slider its plastic strain, and by how much it slips now"""
ROWS = SLIP + 1
N_STRESS = 21 * LANES
"""numbers of Lambda in a batch"""

# Entries of the constants array, see `hourglass.block_constants`.
MU, LAM, B, G, PAIR, SHEAR, TWIST, BOUND, PARAMETERS = 0, 1, 2, 5, 8, 17, 23, 26, 30
N_OF_BOX = PARAMETERS
"""numbers of boxes before PARAMETERS"""
N_CONSTANTS = PARAMETERS + MAX_PARAMETERS
