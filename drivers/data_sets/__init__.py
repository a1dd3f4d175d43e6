"""Published data sets of landmarks as sources of frames: MRCLAM and Victoria Park."""
