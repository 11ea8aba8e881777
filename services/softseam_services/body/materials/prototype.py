"""How kernels call a law by its address: what a response takes and returns, of a law without state and with one."""

from softseam_services.jit import Prototype

MAX_PARAMETERS = 16
"""numbers of a law, at most; every layout that holds a material's parameters has room for as many"""
RESPONSE = Prototype(
    "response of a material law",
    {"i1": float, "i2": float, "j": float, "parameters": (MAX_PARAMETERS,)},
    returns=10,
)
RESPOND = Prototype(
    "response of a material law with state",
    {
        "n": int,
        "F": (3, 3),
        "state": ("n",),
        "dt": float,
        "parameters": (MAX_PARAMETERS,),
        "P": (3, 3),
        "A": (9, 9),
        "following": ("n",),
    },
    returns=2,
    lengths=("n",),
)
"""energy density, and what the step dissipated of it [Pa]; P, A = dP/dF and the state at the end of dt in place"""
