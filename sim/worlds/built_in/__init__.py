"""Worlds that come with the project."""
