"""Array aliases with shapes, for annotations only.

Vectors along the body hold their components first, `(3, n)`, so that one row is one
component at every node.
"""

from typing import TypeAlias

from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Complex, Float, Int

Scalar: TypeAlias = Float[Array, ""]
Vec3: TypeAlias = Float[Array, "3"]
Mat3: TypeAlias = Float[Array, "3 3"]
Nodes: TypeAlias = Float[Array, " n"]
Nodes3: TypeAlias = Float[Array, "3 n"]
NodesNodes: TypeAlias = Float[Array, "n n"]
State: TypeAlias = Float[Array, " s"]
Integer: TypeAlias = Int[Array, ""]
Flag: TypeAlias = Bool[Array, ""]

__all__ = [
    "Array",
    "ArrayLike",
    "Bool",
    "Complex",
    "Flag",
    "Float",
    "Int",
    "Integer",
    "Mat3",
    "Nodes",
    "Nodes3",
    "NodesNodes",
    "Scalar",
    "State",
    "Vec3",
]
