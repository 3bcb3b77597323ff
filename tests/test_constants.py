"""A constant without a source names the decision that it belongs to."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

SOURCE = Path(__file__).parents[1] / "src/taxel"
DECISION = re.compile(r"decisions?/\d{4}|decisions? \d+|\b00\d\d\b")


def own_choices(body: list[ast.stmt]) -> Iterator[str]:
    """Yield what stands below each constant that is our choice, classes' fields included."""
    for node, below in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.ClassDef):
            yield from own_choices(node.body)
        match below:
            case ast.Expr(value=ast.Constant(value=str(words))) if (
                isinstance(node, ast.Assign | ast.AnnAssign) and "our choice" in words.lower()
            ):
                yield " ".join(words.split())


def test_our_choice_names_a_decision_below_the_constant_or_in_the_modules_docstring():
    unnamed = {}
    for path in sorted(SOURCE.rglob("*.py")):
        text = path.read_text("utf-8")
        if "our choice" in text.lower():
            tree = ast.parse(text)
            if not DECISION.search(ast.get_docstring(tree) or ""):
                found = [words for words in own_choices(tree.body) if not DECISION.search(words)]
                unnamed |= {str(path.relative_to(SOURCE)): found} if found else {}

    assert unnamed == {}
