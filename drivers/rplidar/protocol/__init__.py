"""Requests and answers of the RPLIDAR protocol as values, and the serial link that carries them."""
