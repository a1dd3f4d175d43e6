"""Published data sets of landmarks as sources of frames: MRCLAM and Victoria Park.

The room promises frames with observations in place of scans. It may import the modules of ``drivers`` itself and
``features``.
"""
