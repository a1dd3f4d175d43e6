"""Commands about scanners: list, emulate, record, replay, and map live."""
