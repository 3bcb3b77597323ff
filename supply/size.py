"""Measure the size of `src/`: `make size`.

Code lines, lengths of functions, their parameters, docstrings and units. A code line carries at
least one token that is neither a comment nor documentation, which is a string that stands alone as
a statement. A function's length is its code lines from `def` to its end, nested functions included.
Public is what has no leading underscore, in a module or in a public class. Runs nothing of what it
reads (docs/decisions/0048).

    python -m supply.size [FOLDER]     # a folder of modules, src/ by default
"""

from __future__ import annotations

import ast
import io
import re
import statistics
import sys
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

MOST_PARAMETERS = 7
Function = ast.FunctionDef | ast.AsyncFunctionDef
SILENT = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
          tokenize.ENCODING, tokenize.ENDMARKER}  # fmt: skip
"""Tokens that make no line a code line."""
QUANTITY = re.compile(r"\bfloat|NDArray|Tensor")
"""Annotations that pass a quantity."""
SUFFIX = re.compile(
    r"(_|\b)(s|ms|us|ns|hz|v|mv|n|mm|mm2|m|px|pct|db|deg|rad|c|k|g|kg|a|w|pa|kpa|bytes|fps)\b"
)
"""A name that ends in its unit."""
WORDS = re.compile(
    r"second|minute|hertz|\bHz\b|volt|newton|millimet|\bmm\b|pixel|degree|radian|percent|%|°|bytes?"
    r"|\bshape\b|unitless|0\s?(…|\.\.\.?|to)\s?1\b|share|probabilit|logits?|accuracy|ratio|fraction"
    r"|standard deviation|\bgains?\b|grey|scores?\b|features?|weights?\b|scaled|counts?\b|scans\b"
    r"|frames\b|steps?\b|labels?\b|classes\b|ROC|interval|indices|index|masks?\b",
    re.IGNORECASE,
)
"""A unit, or what says that the numbers have none, in a docstring or a name."""


@dataclass(frozen=True, slots=True)
class Measured:
    """One function, method or nested function."""

    path: Path
    name: str
    lines: int
    """Code lines."""
    parameters: int
    """Without `self` and `cls`."""
    public: bool
    documented: bool
    quantity: bool
    """Whether it takes or returns numbers that may have a unit."""
    unit: bool
    """Whether a name or the docstring says which."""


@dataclass(frozen=True, slots=True)
class Size:
    """What is printed, and what a test keeps."""

    modules: int
    lines: int
    """All of them, blank ones and documentation included."""
    code_lines: int
    functions: list[Measured]

    @property
    def median(self) -> float:
        """Code lines of a function, median."""
        return statistics.median(function.lines for function in self.functions)

    @property
    def p90(self) -> int:
        """Code lines that nine functions of ten do not exceed."""
        ranked = sorted(function.lines for function in self.functions)
        return ranked[int(0.9 * len(ranked))]

    @property
    def wide(self) -> list[str]:
        """Functions outside `cli/` with too many parameters."""
        return [
            f"{function.path}: {function.name}"
            for function in self.functions
            if function.parameters > MOST_PARAMETERS and "cli" not in function.path.parts
        ]

    @property
    def undocumented(self) -> list[str]:
        """Public functions without a docstring."""
        return [
            f"{function.path}: {function.name}"
            for function in self.functions
            if function.public and not function.documented
        ]

    @property
    def units_named(self) -> float:
        """Share (0…1) of the public functions that pass a quantity and name its unit."""
        passing = [own for own in self.functions if own.public and own.quantity]
        return sum(own.unit for own in passing) / max(1, len(passing))


def measure(folder: Path) -> Size:
    """Measure all modules below a folder."""
    texts = {path: path.read_text("utf-8") for path in sorted(folder.rglob("*.py"))}
    trees = {path: ast.parse(text) for path, text in texts.items()}
    promised = _promised(list(trees.values()))
    functions, lines = [], 0
    for path, tree in trees.items():
        code = _code_lines(texts[path], tree)
        lines += len(code)
        for name, node, public in _functions(tree.body):
            fulfils = "." in name and node.name in promised
            functions.append(_measured(path.relative_to(folder), name, node, public, code, fulfils))
    return Size(len(texts), sum(text.count("\n") for text in texts.values()), lines, functions)


def _code_lines(text: str, tree: ast.AST) -> set[int]:
    """Return the numbers of the lines that carry code."""
    found = {
        line
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type not in SILENT
        for line in range(token.start[0], token.end[0] + 1)
    }
    for node in ast.walk(tree):
        match node:
            case ast.Expr(value=ast.Constant(value=str())):
                found -= _lines_of(node)
    return found


def _lines_of(node: ast.stmt) -> set[int]:
    return set(range(node.lineno, (node.end_lineno or node.lineno) + 1))


def _functions(
    body: list[ast.stmt], prefix: str = "", public: bool = True
) -> Iterator[tuple[str, Function, bool]]:
    """Yield name, node and publicity of each function; nested ones are not public."""
    for node in body:
        own = public and not getattr(node, "name", "").startswith("_")
        if isinstance(node, ast.ClassDef):
            yield from _functions(node.body, f"{prefix}{node.name}.", own)
        elif isinstance(node, Function):
            yield prefix + node.name, node, own
            yield from _functions(node.body, f"{prefix}{node.name}.", public=False)
        else:
            inner = [below for below in ast.iter_child_nodes(node) if isinstance(below, ast.stmt)]
            handlers = [line for handler in getattr(node, "handlers", []) for line in handler.body]
            yield from _functions(inner + handlers, prefix, public)


def _promised(trees: list[ast.Module]) -> set[str]:
    """Return protocols' documented methods: a class that fulfils them needs no copy."""
    return {
        method.name
        for tree in trees
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef) and any("Protocol" in ast.unparse(n) for n in node.bases)
        for method in node.body
        if isinstance(method, Function) and ast.get_docstring(method)
    }


def _measured(
    path: Path, name: str, node: Function, public: bool, code: set[int], fulfils: bool
) -> Measured:
    given = node.args
    stars = [star for star in (given.vararg, given.kwarg) if star]
    listed = [*given.posonlyargs, *given.args, *given.kwonlyargs, *stars]
    listed = [arg for arg in listed if arg.arg not in {"self", "cls"}]
    notes = [arg.annotation for arg in listed] + [node.returns]
    names = " ".join([node.name, *(arg.arg for arg in listed)])
    words = ast.get_docstring(node) or ""
    return Measured(
        path=path,
        name=name,
        lines=len(code & _lines_of(node)),
        parameters=len(listed),
        public=public,
        documented=bool(words) or fulfils,
        quantity=any(QUANTITY.search(ast.unparse(note)) for note in notes if note),
        unit=bool(fulfils or WORDS.search(words) or SUFFIX.search(names) or WORDS.search(names)),
    )


def report(size: Size) -> Iterator[str]:
    """Yield the figures, then each function that breaks a limit."""
    yield f"modules                        {size.modules}"
    yield f"lines                          {size.lines}"
    yield f"code lines                     {size.code_lines}"
    yield f"functions                      {len(size.functions)}"
    yield f"code lines a function, median  {size.median:g}"
    yield f"code lines a function, p90     {size.p90}"
    yield f"over {MOST_PARAMETERS} parameters, outside cli  {len(size.wide)}"
    yield f"public without a docstring     {len(size.undocumented)}"
    yield f"units named                    {size.units_named:.1%}"
    yield from (f"parameters: {name}" for name in size.wide)
    yield from (f"docstring: {name}" for name in size.undocumented)


if __name__ == "__main__":
    for row in report(measure(Path(sys.argv[1] if len(sys.argv) > 1 else "src"))):
        sys.stdout.write(row + "\n")
