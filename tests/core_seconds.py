"""Processor time of each test, children included: `pytest -p tests.core_seconds`.

On a machine that others use as well, this says what a test costs, where a clock would not. Each
process of pytest writes what it ran to `TAXEL_CORE_SECONDS`, a folder, as a table: test, seconds of
processor, seconds of the clock. `python -m tests.core_seconds FOLDER` adds them up by file.
"""

import csv
import os
import sys
import time
from collections import Counter
from collections.abc import Generator
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

rows: list[tuple[str, float, float]] = []


def used_s() -> float:
    """Processor seconds of this process and of those that it started, ended or not."""
    used = sum(os.times()[:4])
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):
            used += sum(child.cpu_times()[:4])
    return used


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    began = time.monotonic()
    result = yield
    rows.append(("(collection)", used_s(), time.monotonic() - began))
    return result


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    before, began = used_s(), time.monotonic()
    result = yield
    rows.append((item.nodeid, used_s() - before, time.monotonic() - began))
    return result


def pytest_sessionfinish() -> None:
    folder = Path(os.environ["TAXEL_CORE_SECONDS"])
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / f"{os.getpid()}.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(rows)


def main() -> None:
    """Print the sum by file, dearest first."""
    used: Counter[str] = Counter()
    for path in Path(sys.argv[1]).glob("*.csv"):
        with path.open(encoding="utf-8", newline="") as file:
            for test, core_s, _ in csv.reader(file):
                used[test.partition("::")[0]] += float(core_s)
    for name, core_s in used.most_common():
        print(f"{core_s:8.1f}  {name}")
    print(f"{used.total():8.1f}  together")


if __name__ == "__main__":
    main()
