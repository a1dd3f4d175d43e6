"""Requests and answers of the RPLIDAR protocol as values, and the serial link that carries them.

The room promises that every failure of the link, and every answer that is unusable or does not come, is a
:class:`drivers.errors.DriverError`. It may import nothing of the other rooms.
"""
