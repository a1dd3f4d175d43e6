"""From the beams of a scan to segments: points in order, clusters by jumps, splits by IEPF, breaks between walls."""
