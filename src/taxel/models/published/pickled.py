"""Arrays out of a pickled PyTorch network, in their order, without unpickling anything.

A network that was pickled whole names classes of its package, which would have to be run. Its
arrays lie in it as byte strings, each as PyTorch stored it: a head, the count of numbers, the
numbers. The stream is only read through, instruction by instruction. Knows nothing
about networks.

Source: Python's `pickletools`; PyTorch's `torch.storage._load_from_bytes`, its older format:
numbers stand last, little-endian, behind their count as eight bytes. Background of our choices:
docs/decisions/0057.
"""

from __future__ import annotations

import pickletools
import struct
from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

from taxel.errors import BadFile
from taxel.plain_text import number_of

_COUNT = struct.Struct("<q")
_BYTES = ("BINBYTES", "SHORT_BINBYTES", "BINBYTES8")
_MEND = "fetch it again"


def arrays_in_order(content: bytes, wanted: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Return a pickled network's first arrays under the names of a network of the same order.

    Args:
        content: The pickle.
        wanted: Name → a tensor of the kind and shape that stands there; there may be more behind.

    Raises:
        BadFile: It is no pickle, or holds other arrays.
    """
    try:
        held = [arg for op, arg, _ in pickletools.genops(content)
                if op.name in _BYTES and isinstance(arg, bytes)]  # fmt: skip
    except (ValueError, IndexError, UnicodeDecodeError, struct.error) as error:
        raise BadFile("a pickled network", f"{error}", _MEND) from error
    if len(held) < len(wanted):
        raise BadFile(number_of(len(wanted), "array"), f"{len(held)}", _MEND)
    return {
        name: _array(name, part, tensor)
        for (name, tensor), part in zip(wanted.items(), held, strict=False)
    }


def _array(name: str, part: bytes, wanted: Tensor) -> Tensor:
    """Return the numbers at the end of a stored array."""
    size = wanted.numel() * wanted.element_size()
    start = len(part) - size
    count = _COUNT.unpack_from(part, start - _COUNT.size)[0] if start >= _COUNT.size else -1
    if count != wanted.numel():
        raise BadFile(
            f"{number_of(wanted.numel(), 'number')} for {name}", number_of(len(part), "byte"), _MEND
        )
    kind = {torch.float32: "<f4", torch.int64: "<i8"}[wanted.dtype]
    values = np.frombuffer(part, kind, wanted.numel(), start)
    return torch.from_numpy(values.copy()).reshape(wanted.shape)
