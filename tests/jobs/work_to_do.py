"""Work for the tests of jobs, in a module that worker processes can import."""

import atexit
import gc
import os
import signal
from collections.abc import Iterator
from pathlib import Path

from taxel.errors import BadInput
from taxel.jobs.running import side_by_side


def square(number: int) -> int:
    return number * number


def leave_a_sign(folder: Path, number: int) -> int:
    """Say in a file that the job was done, and by which process."""
    (folder / f"{number}-{os.getpid()}").touch()
    return number * number


def die_first(folder: Path, number: int, dies: bool) -> int:
    """As `leave_a_sign`, but the first worker with it kills itself."""
    if dies:
        flag = folder / "died"
        try:
            flag.touch(exist_ok=False)
        except FileExistsError:
            return leave_a_sign(folder, number)
        os.kill(os.getpid(), signal.SIGKILL)
    return leave_a_sign(folder, number)


def sign_at_the_end(folder: Path, number: int) -> None:
    """Say in a file that the process ended as processes do."""
    atexit.register((folder / f"{number}-{os.getpid()}").touch)


def opencv_threads(_: int) -> int:
    """Return how many threads OpenCV takes here."""
    import cv2

    return int(cv2.getNumThreads())


def collects(_: int) -> bool:
    return gc.isenabled()


def always_die(_: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def refuse(number: int) -> None:
    raise BadInput("an even number", str(number), "give another")


def fall(number: int) -> float:
    return 1 / (number - number)


def count_up(number: int) -> Iterator[int]:
    yield from range(number)


def where(number: int) -> tuple[int, list[int]]:
    """Return this process and those in which a job of a job is done."""
    return os.getpid(), side_by_side(own_number, [(number,)] * 3, workers=2)


def own_number(_: int) -> int:
    return os.getpid()
