"""Measurement packets of the RPLIDAR protocol: each format decoded and encoded, framed out of a stream of bytes."""
