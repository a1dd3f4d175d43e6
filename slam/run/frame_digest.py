"""A digest of the frames of a source, by which the same frames are known again."""

import functools
import hashlib
import struct
from dataclasses import fields, is_dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from drivers.frame import Frame


def extend_digest(digest: bytes, frame: Frame) -> bytes:
    """Digest of the frames before and one more; two sources that share it share every value of their frames."""
    chain = hashlib.blake2b(digest, digest_size=16)
    _extend(chain, frame)
    return chain.digest()


def _extend(chain: "hashlib.blake2b", value: Any) -> None:
    if isinstance(value, np.ndarray):
        array = cast(NDArray[Any], value)
        chain.update(repr((array.shape, array.dtype.str)).encode())
        chain.update(np.ascontiguousarray(array).data)
    elif isinstance(value, float):
        chain.update(struct.pack("d", value))
    elif is_dataclass(value):
        for name in _names(type(value)):
            _extend(chain, getattr(value, name))
    else:
        chain.update(repr(value).encode())


@functools.cache
def _names(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))
