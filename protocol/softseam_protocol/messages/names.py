"""How bodies, parts and interfaces are called: BODY, BODY.PART and BODY.INTERFACE."""

from collections.abc import Collection

ONLY_BODY = "body"
"""name of the body of a scene that has one, given as `body`"""


def within(body: str, name: str) -> str:
    """Id of a part or an interface of a body.

    >>> within("tofu", "near")
    'tofu.near'
    """
    return f"{body}.{name}"


def local(id: str) -> str:
    """Name of a part or an interface in its body.

    >>> local("tofu.near")
    'near'
    """
    return id.rpartition(".")[2]


def prefix(body: str, bodies: Collection[str]) -> str:
    """What stands before the names of a body's quantities: nothing where there is one body.

    >>> prefix("tofu", ["tofu", "nori"]), prefix("tofu", ["tofu"])
    ('tofu.', '')
    """
    return f"{body}." if len(bodies) > 1 else ""
