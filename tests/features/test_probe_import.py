from .extraction_twin import extract
def test_x(): assert extract
