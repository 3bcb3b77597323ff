"""`taxel demo` with its table's networks trained for one epoch: what the README shows of the demo
leaves the table out, and all that it shows comes from networks that are trained in full.
"""

import sys
from functools import partial

from taxel.cli.main import main
from taxel.evaluation.teng import table_4_1
from taxel.training.loop import TrainConfig

if __name__ == "__main__":
    table_4_1.TengTableConfig = partial(  # type: ignore[misc,assignment]
        table_4_1.TengTableConfig, train=TrainConfig(epochs=1)
    )
    main(sys.argv[1:])
