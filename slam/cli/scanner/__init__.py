"""Commands about scanners: devices, emulate, live, record and replay.

The room promises one module for each command, and that other kinds of scanners need no change in it: they are found
through ``drivers.scanners``. Only ``emulate`` imports ``sim``.
"""
