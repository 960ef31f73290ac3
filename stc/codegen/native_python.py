"""Compiled functions as plain Python, with the arithmetic of the machine.

Python raises where hardware gives inf or nan (division by zero), and NumPy's scalars are slow and wrap around
at 32 bits; so the function's own syntax tree is rewritten a little before it is handed back to Python:
``x[k]`` becomes ``x.item(k)``, ``a / b`` and ``a ** n`` become calls.
"""

from __future__ import annotations

import ast
import copy
from collections.abc import Callable
from typing import Any

from stc.codegen.native_math import divide, integer_power

_DIVIDE = "__stc_divide"
_POWER = "__stc_power"


class _Machine(ast.NodeTransformer):
    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.ctx, ast.Load) and not isinstance(node.slice, ast.Slice):
            method = ast.Attribute(node.value, "item", ast.Load())
            return ast.copy_location(ast.Call(method, [node.slice], []), node)
        return node

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        name = {ast.Div: _DIVIDE, ast.Pow: _POWER}.get(type(node.op))
        if name is None:
            return node
        call = ast.Call(ast.Name(name, ast.Load()), [node.left, node.right], [])
        return ast.copy_location(call, node)

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        # Spelt out, so that the reads go through the two methods above.
        source = copy.deepcopy(node.target)
        source.ctx = ast.Load()
        assign = ast.Assign([node.target], ast.BinOp(source, node.op, node.value))
        return self.generic_visit(ast.copy_location(assign, node))

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST | None:
        if node.value is None:
            return ast.copy_location(ast.Pass(), node)
        return self.generic_visit(ast.copy_location(ast.Assign([node.target], node.value), node))


def plain_python(function: Callable[..., Any], definition: ast.FunctionDef) -> Callable[..., Any]:
    """Build the plain Python form of ``function`` from its syntax tree."""
    tree = _Machine().visit(copy.deepcopy(definition))
    tree.decorator_list = []
    tree.returns = None
    for argument in tree.args.args:
        argument.annotation = None
    free = function.__code__.co_freevars
    cells = function.__closure__ or ()
    names = [_DIVIDE, _POWER, *free]
    values = [divide, integer_power, *(cell.cell_contents for cell in cells)]
    module = ast.parse(f"def __stc_make({', '.join(names)}):\n    return {tree.name}")
    maker = module.body[0]
    assert isinstance(maker, ast.FunctionDef)
    maker.body.insert(0, tree)
    ast.fix_missing_locations(module)
    made: dict[str, Any] = {}
    exec(compile(module, function.__code__.co_filename, "exec"), function.__globals__, made)
    result: Callable[..., Any] = made["__stc_make"](*values)
    return result
