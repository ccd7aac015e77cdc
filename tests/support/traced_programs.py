"""What a traced program computes."""

from __future__ import annotations

import math


def matrix_products(jaxpr) -> int:
    """Multiply-adds of all products of two matrices and of all convolutions in a traced program.

    Products with a single vector are left out, and those without a sum.
    """
    total = 0
    for equation in jaxpr.eqns:
        repeat = equation.params.get("length", 1) if equation.primitive.name == "scan" else 1
        for value in equation.params.values():
            inner = getattr(value, "jaxpr", value)
            total += repeat * matrix_products(inner) if hasattr(inner, "eqns") else 0
        if equation.primitive.name == "dot_general":
            total += _product(equation)
        if equation.primitive.name == "conv_general_dilated":
            total += _convolution(equation)
    return total


def _convolution(equation) -> int:
    """Of every output number as many as the kernel has for it, those on zeros beyond the border among them."""
    kernel, layout = equation.invars[1].aval.shape, equation.params["dimension_numbers"]
    return math.prod(equation.outvars[0].aval.shape) * math.prod(kernel) // kernel[layout.rhs_spec[0]]


def _product(equation) -> int:
    (contracted, other), (batch, _) = equation.params["dimension_numbers"]
    left, right = (v.aval.shape for v in equation.invars)
    shared = math.prod(left[i] for i in contracted) * math.prod(left[i] for i in batch)
    rows = math.prod(left) // shared
    columns = math.prod(right) // shared
    both = len(left) > len(contracted) + len(batch) and len(right) > len(other) + len(batch)
    return shared * rows * columns if both and contracted else 0
