"""Measurement packets of the RPLIDAR protocol: framing in a stream of bytes, decoding and encoding of each format.

The room promises that every format is a :class:`formats.PacketFormat`, and that decoding never raises, whatever the
bytes. It may import ``drivers.counts``, ``drivers.rplidar.protocol.answers`` and ``features``.
"""
