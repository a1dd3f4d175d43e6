"""The serial protocol of the RPLIDAR scanners as functions on bytes, and a driver on top of it.

The room promises the source :class:`Rplidar`, the decoding of its bytes without a port, and encoders for an emulator.
It may import the modules of ``drivers`` itself, ``drivers.recording`` and ``features``; the names of its own rooms are
offered here.
"""

from drivers.counts import Counts
from drivers.live_source import RawTap
from drivers.recording.raw_recording import RawRecorder, RawRecording
from drivers.rplidar.codecs.decoder import SampleDecoder
from drivers.rplidar.codecs.dense import encode_dense
from drivers.rplidar.codecs.express import encode_express
from drivers.rplidar.codecs.formats import FORMATS, PacketFormat
from drivers.rplidar.codecs.hq import encode_hq
from drivers.rplidar.codecs.samples import Join, Samples
from drivers.rplidar.codecs.standard import encode_standard
from drivers.rplidar.codecs.ultra import encode_ultra, optical_offsets
from drivers.rplidar.codecs.ultra_dense import encode_ultra_dense
from drivers.rplidar.lidar import Rplidar
from drivers.rplidar.protocol.answer_search import AnswerSearch
from drivers.rplidar.protocol.answers import (
    Answer,
    Conf,
    Descriptor,
    DeviceInfo,
    Health,
    SampleRate,
    Status,
    pack_conf,
    unpack_name,
    unpack_number,
)
from drivers.rplidar.protocol.requests import Command, Request, RequestReader
from drivers.rplidar.revolutions import RevolutionDecoder, ScanStream

__all__ = [
    "FORMATS",
    "Answer",
    "AnswerSearch",
    "Command",
    "Conf",
    "Counts",
    "Descriptor",
    "DeviceInfo",
    "Health",
    "Join",
    "PacketFormat",
    "RawRecorder",
    "RawRecording",
    "RawTap",
    "Request",
    "RequestReader",
    "RevolutionDecoder",
    "Rplidar",
    "SampleDecoder",
    "SampleRate",
    "Samples",
    "ScanStream",
    "Status",
    "encode_dense",
    "encode_express",
    "encode_hq",
    "encode_standard",
    "encode_ultra",
    "encode_ultra_dense",
    "optical_offsets",
    "pack_conf",
    "unpack_name",
    "unpack_number",
]
