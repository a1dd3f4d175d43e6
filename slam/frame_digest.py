"""A digest of the frames of a source, by which the same frames are known again."""

import hashlib
import struct
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from drivers.frame import Frame


def extend_digest(digest: bytes, frame: Frame) -> bytes:
    """Digest of the frames before and one more; two sources that share it share every value of their frames."""
    chain = hashlib.blake2b(digest, digest_size=16)
    for part in _parts(frame):
        chain.update(part)
    return chain.digest()


def _parts(value: Any) -> Iterator[bytes]:
    if is_dataclass(value):
        for field in fields(value):
            yield from _parts(getattr(value, field.name))
    elif isinstance(value, np.ndarray):
        yield repr((value.shape, value.dtype.str)).encode()
        yield np.ascontiguousarray(value).tobytes()
    elif isinstance(value, float):
        yield struct.pack("d", value)
    else:
        yield repr(value).encode()
