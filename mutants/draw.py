"""Draw mutants with cosmic-ray's operators: `python -m mutants.draw PLACE`, in its environment.

Left out are changes that leave the program as it is: within annotations, which are never
evaluated, within `frozen`, `slots` and `kw_only` of a dataclass, which mypy watches, and those that
swap equality and identity. Every spot is drawn before any spot is drawn twice, so that the
eleven replacements of one plus sign do not crowd out the rest.
"""

from __future__ import annotations

import ast
import json
import random
import sys
from collections.abc import Iterator
from pathlib import Path

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

from mutants.places import COUNT, PLACES, ROOT, SEED, WORK, Place

_NEED_NAMES = {"core/VariableReplacer", "core/VariableInserter"}
_LAYOUT = {"frozen", "slots", "kw_only"}


def draw(place: Place, count: int, seed: int) -> list[dict[str, object]]:
    """Return so many mutants of a place, or all where there are fewer.

    Args:
        place: Its files.
        count: How many.
        seed: Of the order.
    """
    order = random.Random(seed)
    spots: dict[tuple[object, ...], list[tuple[Path, str, int]]] = {}
    for path in place.files():
        for operator, nth, spot in _spots(path.read_text("utf-8")):
            family = operator.partition("_")[0]
            spots.setdefault((path, family, spot), []).append((path, operator, nth))
    groups = list(spots.values())
    order.shuffle(groups)
    for group in groups:
        order.shuffle(group)
    turns = [group[turn] for turn in range(max(map(len, groups))) for group in groups
             if turn < len(group)]  # fmt: skip
    drawn: list[dict[str, object]] = []
    for path, operator, nth in turns:
        mutant = _mutant(path, operator, nth)
        if mutant is not None:
            drawn.append(mutant)
        if len(drawn) == count:
            break
    return drawn


def _spots(source: str) -> Iterator[tuple[str, int, object]]:
    """Yield operator, its n-th use, and where that stands."""
    tree = get_ast(source)
    for name in operator_names():
        if name in _NEED_NAMES or _swaps_identity(name):
            continue
        operator = get_operator(name)()
        uses = (spot for node in ast_nodes(tree) for spot in operator.mutation_positions(node))
        for nth, spot in enumerate(uses):
            yield name, nth, spot


def _swaps_identity(operator: str) -> bool:
    """True where `==` and `is` change places: the same for None, members and small numbers."""
    _, _, words = operator.partition("Operator_")
    before, _, after = words.partition("_")
    identity = {"Is": "IsNot", "IsNot": "Is"}
    if before in identity:
        return after == {"Is": "Eq", "IsNot": "NotEq"}[before]
    return after in identity


def _mutant(path: Path, operator: str, nth: int) -> dict[str, object] | None:
    """Return one mutant as what replaces which lines; None where it changes nothing that runs."""
    source = path.read_text("utf-8")
    mutated = mutate_code(source, get_operator(operator)(), nth)
    if mutated is None or _program(mutated) == _program(source):
        return None
    old, new = source.splitlines(), mutated.splitlines()
    first = next(i for i, (a, b) in enumerate(zip(old, new, strict=False)) if a != b)
    tail = next(i for i, (a, b) in enumerate(zip(old[::-1], new[::-1], strict=False)) if a != b)
    return {
        "file": str(path.relative_to(ROOT)),
        "line": first + 1,
        "operator": operator.removeprefix("core/"),
        "before": "\n".join(old[first : len(old) - tail]).strip(),
        "after": "\n".join(new[first : len(new) - tail]).strip(),
        "source": mutated,
    }


def _program(source: str) -> str | None:
    """Return what of a source is run, as text; None where it is no Python."""
    try:
        tree = ast.parse(source)
    except SyntaxError:
        return None
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            node.returns = None
        elif isinstance(node, ast.arg):
            node.annotation = None
        elif isinstance(node, ast.AnnAssign):
            node.annotation = ast.Constant(None)
        elif isinstance(node, ast.Call):
            node.keywords = [word for word in node.keywords if word.arg not in _LAYOUT]
    return ast.unparse(tree)


def main() -> None:
    """Write a place's mutants to its file in the work folder."""
    name = sys.argv[1]
    WORK.mkdir(parents=True, exist_ok=True)
    (WORK / f"{name}.drawn.json").write_text(json.dumps(draw(PLACES[name], COUNT, SEED)))


if __name__ == "__main__":
    main()
