"""Print the number of lines of code, classes, tests and words of documentation.

Lines of code are counted with Python's tokenizer, without docstrings, comments and blank lines.
"""

from __future__ import annotations

import ast
import io
import tokenize
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SKIPPED = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}


def code_lines(path: Path) -> int:
    """Count the lines of code of a Python file."""
    source = path.read_text(encoding="utf-8")
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in SKIPPED:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and node.body:
            first = node.body[0]
            if (
                isinstance(first, ast.Expr)
                and isinstance(first.value, ast.Constant)
                and isinstance(first.value.value, str)
            ):
                lines.difference_update(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    return len(lines)


def python_files(folder: str) -> list[Path]:
    """List the Python files of a folder, without symbolic links."""
    top = ROOT / folder
    return [
        path
        for path in sorted(top.rglob("*.py"))
        if not any(part.is_symlink() for part in [path, *path.parents])
    ]


def main() -> None:
    """Print one line per folder."""
    code = [*python_files("posekit"), *python_files("validators"), *python_files("viewer")]
    classes = sum(
        isinstance(node, ast.ClassDef) for path in code for node in ast.walk(ast.parse(path.read_text()))
    )
    print(f"code        {sum(map(code_lines, code)):6d} lines in {len(code)} files, {classes} classes")
    for folder in ("tests", "benchmarks"):
        print(f"{folder:11s} {sum(map(code_lines, python_files(folder))):6d} lines")
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    print(f"docs        {sum(len(page.read_text(encoding='utf-8').split()) for page in pages):6d} words")


if __name__ == "__main__":
    main()
