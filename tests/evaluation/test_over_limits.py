"""A bundle over its limits is warned of with what can be done, in options that there are."""

import re

from taxel.cli.training.train import Train
from taxel.evaluation.expert import Measured, _over
from taxel.training.choose.limits import Limits


def test_what_helps_is_an_option_of_train_or_no_option() -> None:
    lines = _over(Measured(mb=30.0, us=5000.0, parity=0.0), Limits(), members=1)
    known = {name.replace("_", "-") for name in Train.__dataclass_fields__}

    assert len(lines) == 2
    assert {name for line in lines for name in re.findall(r"--([a-z-]+)", line)} <= known
    assert lines[1].endswith("with a single model: raise the limit, or import fewer channels")
