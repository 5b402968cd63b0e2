"""Small faults of a source file, each a change of one expression or statement."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from typing import Final, NamedTuple

COMPARISONS: Final[dict[type[ast.cmpop], type[ast.cmpop]]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
OPERATORS: Final[dict[type[ast.operator], type[ast.operator]]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Div,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.BitXor: ast.BitOr,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
}


class Mutant(NamedTuple):
    """One fault: where it is, what stands there before and after, and whether the line runs when it is imported."""

    file: str
    line: int
    start: int
    end: int
    before: str
    after: str
    on_loading: bool

    @property
    def name(self) -> str:
        """Name it by its place and what it puts there: the same in every run."""
        return f"{self.file}:{self.start}:{self.end}:{self.after}"

    def planted(self, source: str) -> str:
        """Return the source with the fault."""
        raw = source.encode()
        return (raw[: self.start] + self.after.encode() + raw[self.end :]).decode()


def mutants(file: str, source: str) -> Iterator[Mutant]:
    """Yield the faults of a file: operators, comparisons, numbers, names in quotes, calls, returns, refusals.

    Left out are annotations, docstrings, `__all__`, what only a type checker reads, the words of refusals, and that
    what is zipped is equally long.
    """
    begins = [0]
    for text in source.encode().splitlines(keepends=True):
        begins.append(begins[-1] + len(text))
    raw = source.encode()

    def place(node: ast.AST) -> tuple[int, int]:
        return (
            begins[node.lineno - 1] + node.col_offset,  # type: ignore[attr-defined]
            begins[node.end_lineno - 1] + node.end_col_offset,  # type: ignore[attr-defined]
        )

    for node, changed, on_loading in _changes(ast.parse(source)):
        start, end = place(node)
        after = changed if isinstance(changed, str) else ast.unparse(changed)
        if isinstance(node, ast.expr):
            after = f"({after})"
        line = node.lineno  # type: ignore[attr-defined]
        yield Mutant(file, line, start, end, raw[start:end].decode(), after, on_loading)


def _changes(tree: ast.Module) -> Iterator[tuple[ast.AST, ast.AST | str, bool]]:
    """Yield nodes, what to put in their place, and whether they run when the file is imported."""
    stack: list[tuple[ast.AST, bool]] = [(tree, True)]
    while stack:
        node, on_loading = stack.pop()
        stack.extend(reversed(list(_inside(node, on_loading))))
        yield from ((node, changed, on_loading) for changed in _changed(node))


def _inside(node: ast.AST, on_loading: bool) -> Iterator[tuple[ast.AST, bool]]:
    """Yield what is below a node and runs, and whether it does so when the file is imported."""
    docstring = None
    if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
        docstring = node.body[0]
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns", "decorator_list", "type_ignores", "bases"):
            continue
        called = field == "body" and isinstance(node, ast.FunctionDef | ast.Lambda)
        for each in value if isinstance(value, list) else [value]:
            if isinstance(each, ast.AST) and each is not docstring and not _not_run(each):
                yield each, on_loading and not called


def _not_run(node: ast.AST) -> bool:
    """Tell of a statement that changes nothing when the product runs, or that is only words."""
    if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
        return True
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return True
    if isinstance(node, ast.JoinedStr | ast.Import | ast.ImportFrom):
        return True
    if isinstance(node, ast.keyword) and node.arg == "strict":
        return True
    return isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"


def _changed(node: ast.AST) -> Iterator[ast.AST | str]:
    """Yield what a node becomes."""
    match node:
        case ast.Compare(left, [operator], [right]):
            yield ast.Compare(left, [COMPARISONS[type(operator)]()], [right])
        case ast.BinOp(left, operator, right) if type(operator) in OPERATORS:
            yield ast.BinOp(left, OPERATORS[type(operator)](), right)
        case ast.AugAssign(target, operator, value) if type(operator) in OPERATORS:
            yield ast.AugAssign(target, OPERATORS[type(operator)](), value)
        case ast.BoolOp(operator, values):
            yield ast.BoolOp(ast.And() if isinstance(operator, ast.Or) else ast.Or(), values)
        case ast.UnaryOp(ast.Not() | ast.USub() | ast.Invert(), operand):
            yield operand
        case ast.Call(function, arguments, [*keywords, ast.keyword(str() as last)]) if last != "strict":
            yield ast.Call(function, arguments, keywords)
        case ast.IfExp(test, body, orelse):
            yield ast.IfExp(test, orelse, body)
        case ast.Constant(value):
            yield from map(ast.Constant, _other_values(value))
        case ast.Return(ast.expr() as value) if not _is_none(value):
            yield "return None"
        case ast.Raise() | ast.Continue() | ast.Break() | ast.Expr(ast.Call()):
            yield "pass"


def _other_values(value: object) -> Iterator[bool | int | float | str]:
    """Yield what stands for a constant: the next number, twice as much, a name with a letter more; never for a text."""
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, int):
        yield value + 1
    elif isinstance(value, float):
        yield 2 * value if value else 1.0
    elif isinstance(value, str) and value and " " not in value:
        yield f"{value}_"


def _is_none(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and node.value is None
